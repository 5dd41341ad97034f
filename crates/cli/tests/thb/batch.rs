//! Many parts in one run.

use serde_json::Value;

use crate::lab::Lab;
use crate::scans;

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_broken_part_does_not_stop_the_others() {
    for jobs in [1, 2, 8] {
        let lab = Lab::with("a.off", scans::mesh());
        lab.put("broken.off", "OFF\n3 1 0\n0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n");
        lab.put("c.csv", scans::gridded());
        let run = lab.thb(&format!("fit a.off broken.off c.csv -o out/ --summary out/all.jsonl --jobs {jobs}"));
        assert_eq!(run.code, 1, "{run:?}");
        assert_eq!(run.stdout, "");
        assert_eq!(run.stderr.lines().filter(|line| line.contains("broken.off")).count(), 1, "{run:?}");
        assert!(run.stderr.contains("broken.off") && run.stderr.contains("zero"), "{run:?}");
        let written = ["a.json", "a.report.json", "a.step", "all.jsonl", "c.json", "c.report.json", "c.step"];
        let mut expected: Vec<String> = written.iter().map(|name| format!("out/{name}")).collect();
        expected.extend(["a.off", "broken.off", "c.csv"].map(str::to_owned));
        expected.sort();
        assert_eq!(lab.files().into_iter().collect::<Vec<_>>(), expected);

        let summary = lines(&lab.text("out/all.jsonl"));
        let of = |key: &str| summary.iter().map(|line| line[key].as_str().unwrap_or_default()).collect::<Vec<_>>();
        assert_eq!(of("input"), ["a.off", "broken.off", "c.csv"]);
        assert_eq!(of("status"), ["fitted", "failed", "fitted"]);
        assert!(of("error")[1].contains("zero"));
        for (line, report) in [(&summary[0], "out/a.report.json"), (&summary[2], "out/c.report.json")] {
            let result = &lab.json(report)["result"];
            for key in ["dofs", "levels", "max", "rmse", "within", "tolerance", "stop", "reached"] {
                assert_eq!(line[key], result[key], "{key}");
            }
            assert_eq!(line["outputs"].as_array().unwrap().len(), 3);
        }
    }
}

#[test]
fn the_worst_part_decides_the_exit_code() {
    let lab = Lab::with("a.off", scans::mesh());
    lab.put("plane.csv", "i,j,x,y,z\n0,0,0,0,0\n1,0,1,0,0\n0,1,0,1,0\n1,1,1,1,0\n");
    // The plane is met by any surface; the other part is not.
    let run = lab.thb("fit plane.csv a.off -o out --summary all.jsonl --levels 1 --tol 1e-6% --lambda 1e-9");
    assert_eq!(run.code, 3, "{run:?}");
    let summary = lines(&lab.text("all.jsonl"));
    assert_eq!(summary.iter().map(|line| line["reached"].as_bool().unwrap()).collect::<Vec<_>>(), [true, false]);
    assert_eq!(lab.thb("fit plane.csv a.off missing.off -o out --levels 1 --tol 1e-6% --lambda 1e-9").code, 1);
    assert_eq!(lab.thb("fit plane.csv -o out --levels 1 --tol 1e-6% --lambda 1e-9").code, 0);
}

#[test]
fn a_part_has_the_same_result_alone_and_among_others() {
    let lab = Lab::with("a.off", scans::mesh());
    lab.put("b.csv", scans::gridded());
    lab.succeeds("fit a.off -o alone/");
    lab.succeeds("fit b.csv a.off -o together/ --jobs 2");
    assert!(lab.bytes("alone/a.json") == lab.bytes("together/a.json"));
}
