//! Reports as pages to look at.

use serde_json::Value;

use crate::lab::Lab;
use crate::scans;

/// What the scripts of a page read.
fn data(page: &str) -> Value {
    let (_, behind) = page.split_once("id=\"data\">").unwrap();
    serde_json::from_str(behind.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn the_name_of_a_report_tells_whether_it_is_a_page_and_both_may_be_asked_for() {
    let lab = Lab::with("<i>&'a.off", scans::mesh());
    lab.succeeds("fit <i>&'a.off -o a.step --report a.html --report a.json");
    let (page, report) = (lab.text("a.html"), lab.json("a.json"));
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("&lt;i&gt;&amp;&#39;a.off") && !page.contains("<i>"));
    let data = data(&page);
    assert_eq!(data["headline"]["verdict"], report["result"]["verdict"]);
    assert_eq!(data["tolerance"], report["result"]["tolerance"]);
    assert_eq!(data["steps"].as_array().unwrap().len(), report["history"].as_array().unwrap().len());
    let hash = report["input"]["sha256"].as_str().unwrap();
    assert!(hash.len() == 64 && data["facts"].as_array().unwrap().iter().any(|fact| fact["value"] == hash));
    assert!(report["program"].as_str().unwrap().starts_with("thb "));
}

#[test]
fn directories_get_pages_unless_they_are_not_wanted() {
    let lab = Lab::with("a.off", scans::mesh());
    lab.put("b.csv", scans::gridded());
    lab.succeeds("fit a.off b.csv -o out");
    let index = lab.text("out/index.html");
    assert!(index.contains("2 parts: ") && index.contains("\"a.html\"") && index.contains("\"b.html\""));
    lab.succeeds("fit a.off -o one");
    assert!(lab.files().contains("one/a.html") && !lab.files().contains("one/index.html"));
    lab.succeeds("fit a.off b.csv -o none --no-html");
    assert!(!lab.files().iter().any(|name| name.starts_with("none/") && name.ends_with(".html")));
    // The page of the batch would take the place of that of a part.
    lab.put("index.off", scans::mesh());
    lab.fails("fit a.off index.off -o out", 2, &["index.html"]);
    lab.succeeds("fit a.off index.off -o out --no-html");
}

#[test]
fn curves_and_parameters_have_no_page() {
    let lab = Lab::with("b.csv", scans::gridded());
    lab.fails("fit-curve b.csv -o b.json --report b.html", 2, &["JSON"]);
    lab.fails("param b.csv --report b.html", 2, &["JSON"]);
}
