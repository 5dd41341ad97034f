//! Options in files: configurations, presets, reports that are done again, manifests.

use serde_json::Value;

use crate::lab::Lab;
use crate::scans;

fn options(lab: &Lab, report: &str) -> Value {
    lab.json(report)["options"].clone()
}

#[test]
fn all_options_are_printed_and_read_back() {
    let lab = Lab::new();
    let all = lab.thb("fit --print-config");
    assert!(all.code == 0 && all.stderr.is_empty(), "{all:?}");
    lab.put("all.toml", &all.stdout);
    assert_eq!(lab.thb("fit --config all.toml --print-config").stdout, all.stdout);
    // Every option of the help stands there, but those that say where options come from.
    let help = lab.thb("fit --help").stdout;
    let names = help.split_whitespace().filter_map(|word| word.strip_prefix("--"));
    let first = |word: &str| word.split(|c: char| !c.is_ascii_alphanumeric() && c != '-').next().unwrap().to_owned();
    let of_lines = help.lines().filter(|line| line.trim_start().starts_with('-')).collect::<Vec<_>>().join("\n");
    let elsewhere = ["config", "print-config", "preset", "manifest", "shard", "help", "verbose"];
    let mut count = 0;
    for name in names.map(first).filter(|name| of_lines.contains(&format!("--{name}"))) {
        let is_there = all.stdout.lines().any(|line| line.trim_start_matches("# ").starts_with(&format!("{name} =")));
        assert!(is_there != elsewhere.contains(&name.as_str()) || name == "nu", "{name}");
        count += 1;
    }
    assert!(count > 60, "{count}");
}

#[test]
fn the_command_line_comes_before_the_file_and_that_before_the_preset() {
    let lab = Lab::with("a.off", scans::mesh());
    lab.put("fit.toml", "tol = \"2%\"\ndegree = [2, 3]\nmax_dofs = 300\nclean = [\"stray\"]\n");
    lab.succeeds("fit a.off --preset mesh --config fit.toml --tol 3% -o a.json --report a.report.json");
    let options = options(&lab, "a.report.json");
    assert_eq!((&options["tol"], &options["within"]), (&"3%".into(), &0.99.into()));
    assert_eq!(options["degree"], serde_json::json!([2, 3]));
    assert_eq!((&options["max_dofs"], &options["clean"]), (&300.into(), &serde_json::json!(["stray"])));
}

#[test]
fn every_preset_is_a_configuration() {
    let lab = Lab::new();
    let none = lab.thb("fit --print-config").stdout;
    for preset in ["scan", "mesh", "terrain", "blade", "research"] {
        let run = lab.thb(&format!("fit --preset {preset} --print-config"));
        assert!(run.code == 0 && run.stdout != none, "{preset}: {run:?}");
    }
}

#[test]
fn what_is_wrong_in_a_configuration_has_its_file_line_and_key() {
    let lab = Lab::with("a.off", scans::mesh());
    for (text, told) in [
        ("\n\ntolx = 1\n", ["fit.toml:3", "\"tolx\"", "tol may be meant"]),
        ("levels = 3\ntol = \"tight\"\n", ["fit.toml:2", "tol:", "\"tight\" is not possible"]),
        ("flip = 3\n", ["fit.toml:1", "flip:", "true or false"]),
        ("jobs = 0\n", ["fit.toml:1", "jobs:", "\"0\" is not possible"]),
        ("degree = { u = 2 }\n", ["fit.toml:1", "degree:", "table"]),
        ("tol = 1\ntol 2\n", ["fit.toml:2", "=", ""]),
        ("manifest = \"a\"\n", ["fit.toml:1", "\"manifest\"", "no option"]),
    ] {
        lab.put("fit.toml", text);
        lab.fails("fit a.off -o a.json --config fit.toml", 2, &told);
    }
    lab.fails("fit a.off -o a.json --config none.toml", 2, &["none.toml"]);
    lab.fails("fit a.off -o a.json --preset dirt", 2, &["dirt", "scan"]);
}

/// Every option that a report has can be said again, and says the same.
#[test]
fn a_report_is_done_again() {
    let lab = Lab::with("a.off", scans::mesh());
    lab.put("b.csv", scans::gridded());
    let plain = "fit a.off -o first.json --report first.report.json";
    let chosen = "fit b.csv --tol 1% --degree 2,3 --mesh 5x4 --lambda 1e-7 --mark share:0.2 --extension 1,2 --within 0.9 \
                  --robust lp:1.5 --method a-pdm --corrections 2 --closed none --clean none --units inch --flip --normals none \
                  --energy gauss-p --format csv --decimal point --subset 700 --crop=-1,2,-1,2 --refine off --levels 5 \
                  -o first.json --report first.report.json";
    let pieces = "fit a.off --piece all --samples vertices -o first.json --report first.report.json";
    for typed in [plain, chosen, pieces] {
        assert!([0, 3].contains(&lab.thb(typed).code), "{typed}");
        let run = lab.thb("fit --config first.report.json -o second.json --report second.report.json");
        assert!([0, 3].contains(&run.code), "{typed}: {run:?}");
        assert_eq!(options(&lab, "second.report.json"), options(&lab, "first.report.json"), "{typed}");
        let model = |name: &str| std::fs::read(lab.path(name)).ok();
        assert!(model("second.json") == model("first.json"), "{typed}");
    }
    // Another scan under the name is told.
    lab.succeeds(plain);
    lab.put("a.off", scans::mesh().replace("OFF", "OFF\n# changed"));
    assert!(lab.thb("fit --config first.report.json -o second.json").stderr.contains("not what it was"));
    let report = lab.text("first.report.json");
    lab.put("other.json", report.replace("\"far\":", "\"far_away\":"));
    lab.fails("fit --config other.json -o second.json", 2, &["other.json", "policy"]);
    lab.put("other.json", report.replace("\"max_dofs\":", "\"max_dogs\": 3, \"max_dofs\":"));
    lab.fails("fit --config other.json -o second.json", 2, &["other.json", "max_dogs", "max-dofs may be meant"]);
    lab.put("other.json", "{}");
    lab.fails("fit --config other.json -o second.json", 2, &["other.json", "no report"]);
}

#[test]
fn a_manifest_names_parts_and_their_options() {
    let lab = Lab::with("in/a.off", scans::mesh());
    lab.put("in/b.csv", scans::gridded());
    lab.put(
        "parts.csv",
        "# two of one scan\ninput,name,tol,mesh\nin/a.off,,,\nin/a.off,coarse,5%,\"2,3\"\nin/b.csv,,,\n",
    );
    lab.succeeds("fit --manifest parts.csv --tol 1% -o out --summary all.jsonl -q");
    let tol = |name: &str| options(&lab, &format!("out/{name}.report.json"))["tol"].clone();
    assert_eq!(["a", "coarse", "b"].map(tol), ["1%", "5%", "1%"]);
    assert_eq!(options(&lab, "out/coarse.report.json")["mesh"], serde_json::json!([2, 3]));
    assert_eq!(lab.text("all.jsonl").lines().count(), 3);
    lab.put(
        "parts.toml",
        "[[part]]\ninput = \"in/a.off\"\n\n[[part]]\ninput = \"in/a.off\"\nname = \"coarse\"\ntol = \"5%\"\nmesh = [2, 3]\n\n\
         [[part]]\ninput = \"in/b.csv\"\n",
    );
    lab.succeeds("fit --manifest parts.toml --tol 1% -o again -q");
    for name in ["a", "coarse", "b"] {
        assert!(lab.bytes(&format!("out/{name}.json")) == lab.bytes(&format!("again/{name}.json")), "{name}");
    }
}

#[test]
fn what_is_wrong_in_a_manifest_has_its_file_line_and_key() {
    let lab = Lab::with("a.off", scans::mesh());
    for (name, text, told) in [
        ("m.csv", "input,tolx\na.off,1\n", ["m.csv:1", "\"tolx\"", "tol may be meant"]),
        ("m.csv", "input,tol\na.off,1\na.off,tight\n", ["m.csv:3", "tol:", "tight"]),
        ("m.csv", "input,tol\na.off,1\n,2\n", ["m.csv:3", "input", ""]),
        ("m.csv", "input,tol\na.off,1,3\n", ["m.csv:2", "3 cells", "2 columns"]),
        ("m.csv", "tol\n1\n", ["m.csv:1", "input", ""]),
        ("m.csv", "input\n", ["m.csv", "no part", ""]),
        ("m.csv", "input,name\na.off,../b\n", ["m.csv:2", "name:", "../b"]),
        ("m.csv", "input,jobs\na.off,2\n", ["m.csv:1", "\"jobs\"", "no option"]),
        ("m.csv", "input,name\na.off,b\na.off,b\n", ["a.off", "both", "\"b\""]),
        ("m.csv", "input,degree\na.off,9\n", ["--degree", "9", ""]),
        (
            "m.toml",
            "[[part]]\ninput = \"a.off\"\n[[part]]\ninput = \"a.off\"\nlevelz = 3\n",
            ["m.toml:5", "\"levelz\"", "levels"],
        ),
        ("m.toml", "[[part]]\ntol = 3\n", ["m.toml:1", "no input", ""]),
        ("m.toml", "tol = 3\n", ["m.toml:1", "\"tol\"", "[[part]]"]),
        ("m.toml", "[[part]\n", ["m.toml:1", "", ""]),
        ("m.txt", "a.off\n", ["m.txt", ".csv", ".toml"]),
    ] {
        lab.put(name, text);
        lab.fails(&format!("fit --manifest {name} -o out"), 2, &told);
    }
    lab.fails("fit a.off --manifest m.csv -o out", 2, &["--manifest"]);
    lab.fails("fit --manifest none.csv -o out", 2, &["none.csv"]);
    lab.fails("fit a.off --shard 3/2 -o out", 2, &["3/2"]);
}
