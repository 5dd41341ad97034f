//! Outputs for which there is no room: whole files or none, and one line that names the file.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use crate::lab::Lab;
use crate::scans;

const OUTPUTS: [&str; 7] = ["a.step", "a.json", "a.xml", "a.obj", "a.ply", "a.vtk", "r.json"];

/// Bytes of a block of `ulimit -f` in the shell of POSIX.
const BLOCK: u64 = 512;

/// Runs a fit of `a.off` that writes all outputs, none of which may be larger than so many blocks: a write beyond fails as that on a full
/// disk does. (SIGXFSZ would end the program before.)
fn fit_with_room(lab: &Lab, blocks: u64) -> (i32, String) {
    let outputs: String = OUTPUTS[..6].iter().map(|name| format!(" -o {name}")).collect();
    let script = format!(
        "trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" fit a.off{outputs} --report r.json --summary s.jsonl --levels 1 --within 0 --quiet"
    );
    let mut shell = Command::new("sh");
    // STEP files have the time at which they were written.
    shell.args(["-c", &script, env!("CARGO_BIN_EXE_thb")]).env("SOURCE_DATE_EPOCH", "0").current_dir(lab.path(""));
    let run = shell.output().unwrap();
    (run.status.code().expect("thb was killed"), String::from_utf8(run.stderr).unwrap())
}

/// The files of a run by name, and what is equal in all runs: no times.
fn written(lab: &Lab) -> BTreeMap<String, Vec<u8>> {
    let names = lab.files().into_iter().filter(|name| name != "a.off");
    names
        .map(|name| {
            let bytes = match name.as_str() {
                "r.json" => {
                    assert!(lab.text(&name).ends_with("}\n"));
                    lab.json(&name)["result"]["dofs"].to_string().into_bytes()
                }
                "s.jsonl" => {
                    let line: serde_json::Value = serde_json::from_str(&lab.text(&name)).unwrap();
                    line["input"].to_string().into_bytes()
                }
                _ => lab.bytes(&name),
            };
            (name, bytes)
        })
        .collect()
}

#[test]
fn every_output_is_whole_or_not_there_and_the_first_that_fails_is_named() {
    let reference = Lab::with("a.off", scans::mesh());
    assert_eq!(fit_with_room(&reference, 1 << 20), (0, String::new()));
    let whole = written(&reference);
    assert_eq!(whole.len(), OUTPUTS.len() + 1);
    let blocks: BTreeMap<&str, u64> =
        whole.keys().map(|name| (name.as_str(), (reference.bytes(name).len() as u64).div_ceil(BLOCK))).collect();
    // Just too little room for each of the files, and none at all. A report has times, and is not of the same length every time.
    let is_near_report = |room: &u64| (blocks["r.json"] - 1..=blocks["r.json"]).contains(room);
    let too_small = blocks.values().map(|blocks| blocks - 1).filter(|room| !is_near_report(room));
    for room in too_small.chain([0, blocks["r.json"] - 2]).collect::<BTreeSet<_>>() {
        for has_old in [false, true] {
            let lab = Lab::with("a.off", scans::mesh());
            if has_old {
                OUTPUTS.iter().for_each(|name| lab.put(name, "old\n"));
            }
            let (code, stderr) = fit_with_room(&lab, room);
            let fails: Vec<&str> = OUTPUTS.into_iter().filter(|name| blocks[name] > room).collect();
            let summary_fails = room == 0;
            assert_eq!(code, i32::from(!fails.is_empty() || summary_fails), "{room} blocks: {stderr}");
            // The outputs are written in their order up to the first that fails; the summary has a line of its own.
            let lines: Vec<&str> = stderr.lines().collect();
            assert_eq!(
                lines.len(),
                usize::from(!fails.is_empty()) + usize::from(summary_fails),
                "{room} blocks: {stderr}"
            );
            if let Some(first) = fails.first() {
                assert!(lines[0].contains(first) && lines[0].starts_with("thb: a.off: "), "{room} blocks: {stderr}");
            }
            if summary_fails {
                assert!(lines[lines.len() - 1].contains("s.jsonl"), "{stderr}");
            }
            let kept = OUTPUTS.iter().position(|name| fails.first() == Some(name)).unwrap_or(OUTPUTS.len());
            for (at, name) in OUTPUTS.iter().enumerate() {
                match (at < kept, has_old) {
                    (true, _) => assert!(
                        name.ends_with("r.json") || lab.bytes(name) == whole[*name],
                        "{name} is not whole with room for {room} blocks"
                    ),
                    (false, true) => assert_eq!(lab.text(name), "old\n", "{name} with room for {room} blocks"),
                    (false, false) => assert!(!lab.path(name).exists(), "{name} with room for {room} blocks"),
                }
            }
            assert!(lab.files().iter().all(|name| !name.ends_with(".part")), "{:?}", lab.files());
        }
    }
}

/// Without a file system that is full: a device that is.
#[cfg(target_os = "linux")]
#[test]
fn outputs_to_a_full_device_are_told() {
    let lab = Lab::with("a.off", scans::mesh());
    for output in ["o.step", "o.json", "o.obj"] {
        std::os::unix::fs::symlink("/dev/full", lab.path(output)).unwrap();
        let run = lab.thb(&format!("fit a.off -o {output} --levels 1 --within 0 --quiet"));
        assert!(run.code == 1 && run.stderr.lines().count() == 1 && run.stderr.contains(output), "{run:?}");
    }
    std::os::unix::fs::symlink("/dev/full", lab.path("r.json")).unwrap();
    for arguments in
        ["fit a.off -o a.step --report r.json --levels 1 --within 0 --quiet", "param a.off -o a.csv --report r.json"]
    {
        let run = lab.thb(arguments);
        assert!(run.code == 1 && run.stderr.lines().count() == 1 && run.stderr.contains("r.json"), "{run:?}");
    }
}
