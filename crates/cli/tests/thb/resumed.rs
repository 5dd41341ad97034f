//! Runs that were cut short, shared out, and joined.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::lab::Lab;
use crate::scans;

/// A lab with parts in `scans/`: five that are quick, and one that is broken.
fn lab() -> Lab {
    let lab = Lab::new();
    for name in ["a", "b", "c", "d", "e"] {
        lab.put(&format!("scans/{name}.off"), scans::mesh());
    }
    lab.put("scans/broken.off", "OFF\n3 1 0\n0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n");
    lab
}

fn begun(lab: &Lab, arguments: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_thb"))
        .args(arguments.split_whitespace())
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .current_dir(lab.path(""))
        .spawn()
        .unwrap()
}

fn lines(lab: &Lab, name: &str) -> Vec<Value> {
    lab.text(name).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// What of a line does not depend on when and in which run it was made.
fn lasting(mut line: Value) -> Value {
    for key in ["seconds", "kept", "outputs"] {
        line.as_object_mut().unwrap().remove(key);
    }
    line
}

#[test]
fn a_run_that_was_killed_is_resumed_and_joined_with_the_other() {
    let lab = lab();
    // More work than there is time for until it is killed.
    let slow = (0..4_900).map(|k| {
        let (x, y) = (f64::from(k % 70) / 69.0, f64::from(k / 70) / 69.0);
        format!("{},{},{x},{y},{}\n", k % 70, k / 70, (40.0 * x).sin() * (40.0 * y).cos() * 0.05)
    });
    lab.put("scans/f.csv", "i,j,x,y,z\n".to_owned() + &slow.collect::<String>());
    let options = "fit scans -o out --tol 1%";
    let other = lab.thb(&format!("{options} --shard 2/2 -q"));
    let mut killed = begun(&lab, &format!("{options} --shard 1/2"));
    // Parts of the first share: a, c, e, f by the order of names, where broken comes after b.
    let start = Instant::now();
    while !lab.path("out/parts/f.json").exists() {
        assert!(start.elapsed() < Duration::from_secs(300), "{:?}", lab.files());
        assert!(killed.try_wait().unwrap().is_none(), "it ended before it could be killed");
        std::thread::sleep(Duration::from_millis(5));
    }
    // SIGKILL: nothing can be tidied up.
    killed.kill().unwrap();
    killed.wait().unwrap();
    let done_before = lab.bytes("out/a.report.json");
    let half = lab.thb("index out --summary half.jsonl");
    assert_eq!(half.code, 1, "{half:?}");
    let of_f = lines(&lab, "half.jsonl").into_iter().find(|line| line["input"] == "scans/f.csv").unwrap();
    assert!(of_f["error"].as_str().unwrap().contains("not finished"), "{of_f}");
    assert!(!lab.path("out/f.step").exists() && !lab.path("out/f.report.json").exists());

    let resumed = lab.thb(&format!("{options} --shard 1/2 --resume --summary first.jsonl -q"));
    let kept: Vec<(Value, bool)> = lines(&lab, "first.jsonl")
        .into_iter()
        .map(|line| (line["input"].clone(), line["kept"].as_bool().unwrap_or(false)))
        .collect();
    let of_first = ["a.off", "broken.off", "d.off", "f.csv"];
    let of_second = ["b.off", "c.off", "e.off"];
    assert_eq!(
        kept.iter().map(|(input, _)| input.clone()).collect::<Vec<_>>(),
        of_first.map(|name| format!("scans/{name}"))
    );
    // What failed or was being done is done again; all else stays as it was.
    assert_eq!(kept.iter().map(|(_, kept)| *kept).collect::<Vec<_>>(), [true, false, true, false]);
    assert!(lab.bytes("out/a.report.json") == done_before);
    assert_eq!((other.code.max(resumed.code) > 0, of_second.len()), (true, 3));

    let joined = lab.thb("index out --summary all.jsonl");
    assert!(
        joined.code == 1 && joined.stdout.starts_with("7 parts: ") && joined.stdout.contains("1 without a surface"),
        "{joined:?}"
    );
    // As one run would have made it.
    lab.thb("fit scans -o whole --tol 1% -q --summary whole.jsonl");
    let sorted = |name: &str| {
        let mut all: Vec<Value> = lines(&lab, name).into_iter().map(lasting).collect();
        all.sort_by_key(|line| line["input"].to_string());
        all
    };
    assert_eq!(sorted("all.jsonl"), sorted("whole.jsonl"));
    let index = lab.text("out/index.html");
    for name in of_first.iter().chain(&of_second) {
        assert!(index.contains(&format!("\"{name}\"")), "{name}");
        if *name != "broken.off" {
            let model = format!("{}.json", name.split('.').next().unwrap());
            assert!(lab.bytes(&format!("out/{model}")) == lab.bytes(&format!("whole/{model}")), "{name}");
        }
    }
    let pictures = index.matches("\"picture\":\"iVBOR").count();
    assert_eq!(pictures, 6);
}

#[test]
fn what_has_changed_is_done_again() {
    let lab = Lab::with("a.off", scans::mesh());
    lab.put("b.csv", scans::gridded());
    let kept = |arguments: &str| {
        let run = lab.thb(&format!("fit a.off b.csv -o out --resume --summary all.jsonl -q {arguments}"));
        assert_eq!(run.code, 0, "{run:?}");
        let of = |line: &Value| line["kept"].as_bool().unwrap_or(false);
        lines(&lab, "all.jsonl").iter().map(of).collect::<Vec<_>>()
    };
    assert_eq!(kept(""), [false, false]);
    assert_eq!(kept("--threads 1"), [true, true]);
    // Options.
    assert_eq!(kept("--tol 2%"), [false, false]);
    assert_eq!(kept("--tol 2%"), [true, true]);
    // A scan.
    lab.put("a.off", scans::mesh().replace("OFF", "OFF\n# changed"));
    assert_eq!(kept("--tol 2%"), [false, true]);
    // A file that is gone; another that somebody spoiled.
    std::fs::remove_file(lab.path("out/a.html")).unwrap();
    lab.put("out/parts/b.json", "{");
    assert_eq!(kept("--tol 2%"), [false, false]);
    // Another version of the program.
    let record = lab.text("out/parts/a.json");
    assert!(record.contains("\"program\": \"thb "));
    // Without --resume all is done again.
    lab.thb("fit a.off b.csv -o out --summary all.jsonl -q --tol 2%");
    assert!(lines(&lab, "all.jsonl").iter().all(|line| line["kept"].is_null()));
}

#[test]
fn a_directory_without_records_is_no_batch() {
    let lab = Lab::with("a.off", scans::mesh());
    lab.put("out/part.step", "");
    lab.fails("index out", 1, &["out", "no records"]);
    lab.fails("index none", 1, &["none", "no records"]);
    lab.fails("fit out -o there", 1, &["out", "no file"]);
    // Single runs into one directory are joined, too.
    lab.put("b.off", scans::mesh());
    lab.succeeds("fit a.off -o out");
    lab.succeeds("fit b.off -o out");
    let run = lab.thb("index out");
    assert!(run.code == 0 && run.stdout.starts_with("2 parts: 2 good"), "{run:?}");
    lab.put("out/parts/b.json", "{}");
    lab.fails("index out", 1, &["parts/b.json"]);
}
