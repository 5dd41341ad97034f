//! Wrong usage ends with code 2 before anything is read or written.

use crate::lab::Lab;
use crate::scans;

#[test]
fn options_out_of_range() {
    let lab = Lab::with("scan.off", scans::mesh());
    for (options, text) in [
        ("--degree 9", "--degree"),
        ("--degree 0", "--degree"),
        ("--degree 2,3,4", "--degree"),
        ("--tol=-1", "--tol"),
        ("--tol -1", "--tol"),
        ("--tol -1%", "--tol"),
        ("--tol 0", "--tol"),
        ("--tol nan", "--tol"),
        ("--tol tight", "--tol"),
        ("--mark share:2", "--mark"),
        ("--mark share:0", "--mark"),
        ("--mark best", "--mark"),
        ("--mesh 0x4", "--mesh"),
        ("--mesh 4x5000", "--mesh"),
        ("--within 1.5", "--within"),
        ("--within -0.5", "--within"),
        ("--lambda -1", "--lambda"),
        ("--levels 0", "--levels"),
        ("--levels 17", "--levels"),
        ("--lambda=-1e-3", "--lambda"),
        ("--lambda inf", "--lambda"),
        ("--extension 65", "--extension"),
        ("--admissible 1", "--admissible"),
        ("--units yard", "--units"),
        ("--method qi2", "--method"),
        ("--jobs 0", "--jobs"),
        ("--unheard-of", "--unheard-of"),
    ] {
        lab.fails(&format!("fit scan.off -o part.step {options}"), 2, &[text]);
    }
}

#[test]
fn outputs_without_a_format() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.fails("fit scan.off -o part.iges", 2, &["part.iges", ".step"]);
    lab.fails("fit scan.off -o part.step -o part.iges", 2, &["part.iges", ".step"]);
    lab.fails("fit scan.off", 2, &["--output"]);
    lab.fails("fit", 2, &[]);
    lab.fails("", 2, &[]);
}

#[test]
fn several_inputs_with_one_output_file() {
    let lab = Lab::with("one.off", scans::mesh());
    lab.put("two.off", scans::mesh());
    lab.put("sub/one.off", scans::mesh());
    lab.fails("fit one.off two.off -o part.step", 2, &["2 inputs", "part.step", "directory"]);
    lab.fails("fit one.off two.off -o out/ --report r.json", 2, &["2 inputs", "r.json", "directory"]);
    lab.fails("fit one.off sub/one.off -o out/", 2, &["one.off", "both"]);
}

#[test]
fn outputs_that_would_overwrite_each_other_or_the_input() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.succeeds("fit scan.off -o scan.ply");
    lab.put("old/scan.step", "kept");
    for outputs in ["-o scan.ply", "-o part.step -o ./scan.ply", "-o old/../scan.ply", "-o part.step --report scan.ply"]
    {
        lab.fails(&format!("fit scan.ply {outputs}"), 2, &["scan.ply", "input"]);
    }
    lab.fails("fit scan.off -o part.json --report part.json", 2, &["two outputs", "part.json"]);
    lab.fails("fit scan.off -o part.json -o old/../part.json", 2, &["two outputs", "part.json"]);
    lab.fails("fit scan.off -o old/ -o old/scan.step", 2, &["two outputs", "scan.step"]);
}

#[test]
fn fewer_control_points_than_the_first_mesh_has_are_refused() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.fails("fit scan.off --mesh 4 --max-dofs 48 -o part.json", 1, &["--max-dofs 48", "49 control points"]);
    let run = lab.thb("fit scan.off --mesh 4 --max-dofs 49 --tol 1e-6 -o part.json");
    assert!(run.code == 3 && run.stderr.contains("failed (max-dofs), 49 control points"), "{run:?}");
}

#[test]
fn outputs_that_cannot_be_written() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.put("file", "not a directory");
    for outputs in ["-o file/part.step", "-o file/deeper/", "-o file/part.vtk"] {
        lab.fails(&format!("fit scan.off {outputs}"), 1, &["scan.off", "file"]);
    }
    // It is told before anything is fitted, and nothing is left behind.
    lab.fails("fit scan.off -o part.json -o file/part.step", 1, &["file/part.step"]);
    lab.fails("fit none.off -o file/part.step", 1, &["file/part.step"]);
    assert_eq!(lab.files(), ["file", "scan.off"].map(str::to_owned).into());
}

#[test]
fn help_and_version_go_to_standard_output() {
    let lab = Lab::new();
    for arguments in ["--help", "--version", "fit --help", "eval --help", "convert --help", "compare --help", "info -h"]
    {
        let run = lab.thb(arguments);
        assert!(run.code == 0 && !run.stdout.is_empty() && run.stderr.is_empty(), "thb {arguments}: {run:?}");
    }
    assert!(lab.thb("fit --help").stdout.contains("--tol"));
    assert!(lab.thb("--help").stdout.contains("Exit codes"));
}

#[test]
fn short_help_has_what_most_people_need() {
    let lab = Lab::new();
    let options = |help: &str| -> Vec<String> {
        let of_line = |line: &str| {
            line.trim_start().starts_with('-').then(|| line.split("--").nth(1)).flatten().map(str::to_owned)
        };
        let names = lab.thb(help).stdout.lines().filter_map(of_line).collect::<Vec<_>>();
        names.iter().map(|name| name.split([' ', '.']).next().unwrap().to_owned()).collect()
    };
    let short = options("fit -h");
    // Ten, and two of every program.
    assert!(short.len() == 12 && short.contains(&"tol".to_owned()), "{short:?}");
    let long = options("fit --help");
    assert!(long.len() > 60 && short.iter().all(|name| long.contains(name)), "{long:?}");
    assert!(lab.thb("fit -h").stdout.lines().count() < 60);
}

#[test]
fn a_tolerance_as_large_as_the_part_is_told() {
    let lab = Lab::with("scan.off", scans::mesh());
    let warned = |tol: &str| {
        let run = lab.thb(&format!("fit scan.off --tol {tol} -o part.json"));
        assert_eq!(run.code, 0, "{run:?}");
        run.stderr.contains("of the diagonal of the scan") && run.stderr.contains("--tol 0.5%")
    };
    assert_eq!(["5", "6%", "4%", "0.01"].map(warned), [true, true, false, false]);
}
