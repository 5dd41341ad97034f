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
        let of_part = |part: &str| ["html", "json", "report.json", "step"].map(|end| format!("out/{part}.{end}"));
        let mut expected = [of_part("a"), of_part("c")].concat();
        expected.extend(["out/all.jsonl", "out/index.html"].map(str::to_owned));
        expected.extend(["a", "broken", "c"].map(|part| format!("out/parts/{part}.json")));
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
            assert_eq!(line["outputs"].as_array().unwrap().len(), 4);
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

/// Every good part of many is fitted, whatever the others hold, and every part has its line.
#[cfg(unix)]
#[test]
fn hostile_parts_among_many_cost_a_line_each() {
    let lab = Lab::with("good0.off", scans::mesh());
    let mut names = vec!["good0.off".to_owned()];
    for k in 1..17 {
        let (name, text) = match k % 2 {
            0 => (format!("good{k}.off"), scans::mesh()),
            _ => (format!("good{k}.csv"), scans::gridded()),
        };
        lab.put(&name, text);
        names.push(name);
    }
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let mut las = vec![0; 227];
    las[..4].copy_from_slice(b"LASF");
    (las[24], las[25], las[94]) = (1, 2, 227);
    (las[96], las[105]) = (227, 1);
    las[107..111].fill(0xff);
    let hostile: [(&str, Vec<u8>); 8] = [
        ("vertices.ply", ply.into()),
        ("records.las", las),
        ("faces.off", b"OFF\n4000000000 4000000000 0\n0 0 0\n".to_vec()),
        ("far.xyz", b"0 0 0\n1 0 0\n0 1 1e300\n1 1 0\n".to_vec()),
        (
            "blind.pcd",
            b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA ascii\nnan nan nan\nnan nan nan\n".to_vec(),
        ),
        ("noise.stl", (0..9000_u32).map(|k| (k * k / 7) as u8).collect()),
        ("line.xyz", (0..60).map(|k| format!("{k} {k} {k}\n")).collect::<String>().into_bytes()),
        ("empty.csv", Vec::new()),
    ];
    for (at, (name, bytes)) in hostile.iter().enumerate() {
        lab.put(name, bytes);
        names.insert(2 * at, (*name).to_owned());
    }
    let script = format!(
        "ulimit -v 4000000; exec \"$0\" fit {} -o out --summary all.jsonl --jobs 8 --levels 2 --within 0 --quiet",
        names.join(" ")
    );
    let run = std::process::Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_thb")])
        .current_dir(lab.path(""))
        .output()
        .unwrap();
    let stderr = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(1), "{stderr}");
    let is_about_threads = |line: &&str| line.contains("times the cores");
    assert_eq!(stderr.lines().filter(|line| !is_about_threads(line)).count(), hostile.len(), "{stderr}");
    let summary = lines(&lab.text("all.jsonl"));
    assert_eq!(summary.iter().map(|line| line["input"].as_str().unwrap()).collect::<Vec<_>>(), names);
    for (line, name) in summary.iter().zip(&names) {
        let is_good = name.starts_with("good");
        assert_eq!(line["status"], if is_good { "fitted" } else { "failed" }, "{line}");
        let stem = name.split('.').next().unwrap();
        assert_eq!(lab.path(&format!("out/{stem}.step")).is_file(), is_good, "{name}");
        assert!(is_good || stderr.lines().filter(|line| line.contains(name)).count() == 1, "{name}: {stderr}");
    }
}
