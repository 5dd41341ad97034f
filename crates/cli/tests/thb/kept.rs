//! What is the user's stays: inputs of every kind, links, names that are no text; and nothing half-written stays behind.

use std::time::{Duration, Instant};

use crate::lab::Lab;
use crate::scans;

#[test]
fn files_that_options_name_are_inputs() {
    let lab = Lab::with("a.off", scans::mesh());
    lab.put("cells.asc", "ncols 2\nnrows 2\nxllcorner -9\nyllcorner -9\ncellsize 9\n1 1\n1 1\n");
    lab.put("rows.json", "0\n1\n2\n3\n");
    for (option, file) in [("--mask", "cells.asc"), ("--outline", "rows.json"), ("--markers", "rows.json")] {
        let told = ["is an input and would be overwritten", file];
        lab.fails(&format!("fit a.off -o a.step {option} {file} --report {file}"), 2, &told);
        lab.fails(&format!("fit a.off -o a.step {option} {file} --summary ./{file}"), 2, &told);
        if option != "--markers" {
            lab.fails(&format!("param a.off -o a.csv {option} {file} --report {file}"), 2, &told);
        }
    }
    lab.fails("fit a.off -o rows.json --outline rows.json", 2, &["is an input", "rows.json"]);
}

#[cfg(unix)]
#[test]
fn links_stay_links() {
    use std::os::unix::fs::symlink;
    let lab = Lab::with("a.off", scans::mesh());
    std::fs::create_dir(lab.path("store")).unwrap();
    // A link to a file that is not there yet makes it, and stays.
    symlink("store/result.step", lab.path("out.step")).unwrap();
    lab.succeeds("fit a.off -o out.step --levels 1 --within 0");
    assert!(lab.path("out.step").is_symlink() && lab.text("store/result.step").starts_with("ISO-10303-21"));
    // Two names of one file that is not there yet.
    symlink("store/other.step", lab.path("other.step")).unwrap();
    // (`fails` would read the links.)
    let fails = |arguments: &str, code: i32, told: &str| {
        let run = lab.thb(arguments);
        assert!(run.code == code && run.stderr.contains(told), "{arguments}: {run:?}");
    };
    fails("fit a.off -o other.step -o store/other.step", 2, "other.step");
    assert!(!lab.path("store/other.step").exists());
    // A link to the input, by way of another one.
    symlink("a.off", lab.path("first.obj")).unwrap();
    symlink("first.obj", lab.path("second.obj")).unwrap();
    fails("fit a.off -o second.obj", 2, "is an input");
    symlink("round.obj", lab.path("round.obj")).unwrap();
    fails("fit a.off -o round.obj --levels 1", 1, "round.obj");
    // Into a folder that is not there.
    symlink("nowhere/a.step", lab.path("lost.step")).unwrap();
    let run = lab.thb("fit a.off -o lost.step --levels 1 --within 0");
    assert!(lab.path("lost.step").is_symlink(), "{run:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_text() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    use std::process::Command;

    let lab = Lab::with("a.off", scans::mesh());
    let names = [&b"b\xff.off"[..], b"b\xfe.off", b"c\x80.off"].map(OsStr::from_bytes);
    names[..2].iter().for_each(|name| std::fs::write(lab.path("").join(name), scans::mesh()).unwrap());
    std::fs::write(lab.path("").join(names[2]), "OFF\n1 0 0\nzero 0 0\n").unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_thb"))
        .args(["fit", "a.off"])
        .args(names)
        .args(["-o", "out", "--summary", "all.jsonl", "--levels", "1", "--within", "0"])
        .current_dir(lab.path(""))
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(1), "{run:?}");
    let summary: Vec<serde_json::Value> =
        lab.text("all.jsonl").lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let status: Vec<&str> = summary.iter().map(|line| line["status"].as_str().unwrap()).collect();
    assert_eq!(status, ["fitted", "fitted", "fitted", "failed"]);
    assert_eq!(summary[1]["input"], "b\u{fffd}.off");
    for name in [&b"b\xff.step"[..], b"b\xfe.step", b"b\xfe.report.json"] {
        assert!(lab.path("out").join(OsStr::from_bytes(name)).is_file());
    }
}

/// Whenever a run is ended, no file under a temporary name stays behind.
#[cfg(unix)]
#[test]
fn a_terminated_run_leaves_nothing_half_written() {
    use std::process::{Command, Stdio};

    let lab = Lab::with("a.off", scans::mesh());
    std::fs::create_dir(lab.path("out")).unwrap();
    for milliseconds in [0, 5, 20, 50, 100, 200] {
        let mut outputs = Vec::new();
        for k in 0..20 {
            outputs.extend(["-o".to_owned(), format!("out/{k}.vtk")]);
        }
        let mut run = Command::new(env!("CARGO_BIN_EXE_thb"))
            .args(["fit", "a.off", "--levels", "1"])
            .args(outputs)
            .current_dir(lab.path(""))
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        // By its id, which is still that of this run: it was not waited for.
        let _ = Command::new("kill").args(["-TERM", &run.id().to_string()]).status().unwrap();
        let start = Instant::now();
        run.wait().unwrap();
        assert!(start.elapsed() < Duration::from_secs(30));
        assert!(!lab.files().iter().any(|name| name.ends_with(".part")), "{:?}", lab.files());
    }
}

#[test]
fn threads_and_jobs_are_at_most_four_a_core() {
    let lab = Lab::with("a.off", scans::mesh());
    for option in ["--threads 1000000", "--jobs 60000"] {
        let run = lab.thb(&format!("fit a.off -o a.step --levels 1 --within 0 {option}"));
        assert!(run.code == 0 && run.stderr.contains("is more than four times the cores"), "{run:?}");
    }
    let run = lab.thb("param a.off --threads 1000000");
    assert!(run.code == 0 && run.stderr.contains("--threads 1000000 is more"), "{run:?}");
}
