//! Methods with moving parameters.

use crate::lab::Lab;
use crate::scans;

#[test]
fn every_method_fits_and_reports_its_moves() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.succeeds("fit scan.off --tol 0.05% -o part.json --report fixed.json");
    let fixed = lab.json("fixed.json");
    assert!(fixed["history"][0]["moves"].is_null());
    for method in
        ["a-pdm", "a-tdm", "a-hdm --blend curvature", "a-hdm --blend 0.5", "j-pdm", "joint", "joint --boundary free"]
    {
        lab.succeeds(&format!("fit scan.off --tol 0.05% --method {method} -o part.json --report r.json"));
        let report = lab.json("r.json");
        let moves = &report["history"][0]["moves"];
        assert!(moves["rmse_before"].as_f64().unwrap() > 0.0 && moves["folds"] == 0, "{method}: {moves}");
        assert!(report["result"]["dofs"].as_u64() <= fixed["result"]["dofs"].as_u64(), "{method}");
        // What the report says of the points holds for the surface that was written.
        let compared = lab.prints_json("compare part.json scan.off --tol 0.05%");
        assert!(compared["within"].as_f64().unwrap() >= report["result"]["within"].as_f64().unwrap(), "{method}");
    }
}

#[test]
fn options_of_methods_are_checked() {
    let lab = Lab::with("scan.off", scans::mesh());
    for arguments in ["--method a-xdm", "--method a-hdm --blend 1.5", "--damping=-1", "--boundary half"] {
        assert_eq!(lab.thb(&format!("fit scan.off -o part.json {arguments}")).code, 2, "{arguments}");
    }
    assert_eq!(lab.files().len(), 1);
}
