//! Fitting methods and their options.

use crate::lab::Lab;
use crate::scans;

/// Share of the scan's area within the tolerance.
fn share_of_area(result: &serde_json::Value) -> f64 {
    result["deviation"]["scan_to_surface"]["within"].as_f64().unwrap()
}

#[test]
fn every_method_fits_and_reports_its_moves() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.succeeds("fit scan.off --tol 0.05% --method ls -o part.json --report fixed.json");
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
        // What the report says of the scan holds for the surface that was written.
        let compared = lab.prints_json("compare part.json scan.off --tol 0.05%");
        assert!((share_of_area(&compared) - share_of_area(&report["result"])).abs() < 1e-3, "{method}");
    }
}

#[test]
fn a_method_left_open_moves_parameters_where_that_spares_control_points() {
    let lab = Lab::with("scan.off", scans::mesh());
    let mut chosen = Vec::new();
    // One level is too few for the last tolerance: the better of both surfaces is kept.
    for limits in ["--tol 0.2%", "--tol 0.02%", "--tol 0.01%", "--tol 0.001% --levels 1 --within 1"] {
        let fit = |method: &str| {
            let run = lab.thb(&format!("fit scan.off {limits} --method {method} -o part.json --report r.json"));
            assert!([0, 3].contains(&run.code), "{limits} {method}: {}", run.code);
            lab.json("r.json")["result"].clone()
        };
        let [open, fixed] = ["auto", "ls"].map(fit);
        let within = |result: &serde_json::Value| result["within"].as_f64().unwrap();
        let dofs = |result: &serde_json::Value| result["dofs"].as_f64().unwrap();
        match (open["method"].as_str(), fixed["reached"] == true) {
            (Some("ls"), _) => assert_eq!([dofs(&open), within(&open)], [dofs(&fixed), within(&fixed)]),
            (Some("joint"), true) => {
                assert!(open["reached"] == true && dofs(&open) <= 0.95 * dofs(&fixed), "{limits}: {open} {fixed}");
            }
            (Some("joint"), false) => {
                assert!(open["reached"] == true || within(&open) >= within(&fixed), "{limits}: {open} {fixed}");
            }
            other => panic!("{other:?}"),
        }
        assert!(open["creases"].as_f64().unwrap() <= 5e-4);
        chosen.push(open["method"].as_str().unwrap().to_owned());
    }
    assert!(chosen.iter().any(|method| method == "joint"), "{chosen:?}");
}

#[test]
fn quasi_interpolation_fits_and_reports_its_local_problems() {
    let lab = Lab::with("scan.off", scans::mesh());
    for method in [
        "qi",
        "qi --n-min 20 --n-loc 40 --splits 2x2 --density 0.5 --nu 0.9",
        "qi --lambda 1e-7 --local-lambda points",
        "qi --lambda 1e-5 --local-lambda area",
        "a-qi --corrections 2",
    ] {
        // Refined as far as the points allow, within the tolerance or not.
        let run = lab.thb(&format!("fit scan.off --tol 0.02% --method {method} -o part.json --report r.json"));
        assert!([0, 3].contains(&run.code), "{method}: {}", run.code);
        let report = lab.json("r.json");
        let history = report["history"].as_array().unwrap();
        let solved = |k: usize| history[k]["quasi"]["solved"].as_u64().unwrap();
        let moves = method.starts_with("a-qi");
        // Corrections solve anew, and once more where moves are undone.
        let rounds = if moves { 3..=4 } else { 1..=1 };
        let functions = history[0]["dofs"].as_u64().unwrap();
        assert!(rounds.map(|round| round * functions).any(|expected| solved(0) == expected), "{method}: {}", solved(0));
        assert!(history.iter().all(|i| i["moves"].is_null() != moves), "{method}");
        let compared = lab.prints_json("compare part.json scan.off --tol 0.02%");
        assert!((share_of_area(&compared) - share_of_area(&report["result"])).abs() < 1e-3, "{method}");
    }
}

#[test]
fn options_of_methods_are_checked() {
    let lab = Lab::with("scan.off", scans::mesh());
    for arguments in [
        "--method a-xdm",
        "--method a-hdm --blend 1.5",
        "--damping=-1",
        "--boundary half",
        "--method qi --n-min 2",
        "--n-min 9 --n-loc 8",
        "--density=-1",
        "--splits 0",
        "--local-lambda x",
    ] {
        assert_eq!(lab.thb(&format!("fit scan.off -o part.json {arguments}")).code, 2, "{arguments}");
    }
    assert_eq!(lab.files().len(), 1);
}
