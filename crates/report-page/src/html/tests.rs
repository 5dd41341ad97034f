//! Tests of the page.

use super::*;

/// A wavy square of n × n points with triangles over them, off by up to two tolerances.
fn page(n: usize) -> Page {
    let at = |k: usize| [(k % n) as f64 / n as f64, (k / n) as f64 / n as f64];
    let noise = |k: usize| ((k as u64).wrapping_mul(6_364_136_223_846_793_005) >> 40) as f64 / f64::from(1 << 24);
    let points = (0..n * n).map(|k| [1e6 + 9.0 * at(k)[0], 7.0 * at(k)[1], noise(k)]).collect();
    let quads = (0..(n - 1) * (n - 1)).map(|q| (q / (n - 1) * n + q % (n - 1)) as u32);
    let m = n as u32;
    let triangles: Vec<[u32; 3]> = quads.flat_map(|a| [[a, a + 1, a + m + 1], [a, a + m + 1, a + m]]).collect();
    let scan = Scan {
        deviations: (0..n * n).map(|k| 4.0 * (noise(k + 1) - 0.5)).collect(),
        parameters: (0..n * n).map(at).collect(),
        triangles: triangles.clone(),
        points,
        ..Scan::default()
    };
    let surface = Surface { vertices: scan.points.clone(), triangles, ..Surface::default() };
    Page {
        headline: Headline { title: "wave.ply".into(), verdict: "usable".into(), ..Headline::default() },
        parts: vec![Part { name: "wave".into(), scan, surface }],
        tolerance: 1.0,
        unit: "mm".into(),
        ..Page::default()
    }
}

/// The text of an element of the page.
fn element<'a>(html: &'a str, id: &str) -> &'a str {
    let (_, behind) = html.split_once(&format!("id=\"{id}\"")).unwrap();
    let (_, inner) = behind.split_once('>').unwrap();
    inner.split_once("</script>").unwrap().0
}

#[test]
fn the_data_of_a_page_is_json_and_nothing_asks_for_another_file() {
    let html = page(20).to_html();
    let data: serde_json::Value = serde_json::from_str(element(&html, "data")).unwrap();
    assert_eq!(data["headline"]["title"], "wave.ply");
    assert_eq!(data["sections"][0]["count"], 400);
    assert_eq!(data["quantiles"].as_array().unwrap().len(), QUANTILES + 1);
    // Everything but the library, which names pages of its documentation in comments and messages.
    let own = html.replace(THREE, "");
    for forbidden in [" src=\"http", "href=\"http", "url(http", "import(", "fetch(", "XMLHttpRequest", "{{"] {
        assert!(!own.contains(forbidden), "{forbidden}");
    }
}

#[test]
fn what_users_write_is_text_and_never_code() {
    let nasty = "</script><script>alert('\"&1')</script><!--";
    let mut page = page(4);
    page.headline.title = nasty.into();
    page.headline.verdict = nasty.into();
    page.parts[0].name = nasty.into();
    page.warnings.push(nasty.into());
    page.facts.push(Fact::new(nasty, nasty));
    let html = page.to_html();
    assert!(!html.contains("<script>alert"));
    let data: serde_json::Value = serde_json::from_str(element(&html, "data")).unwrap();
    assert_eq!(data["warnings"][0], nasty);
    assert_eq!(data["facts"][0]["value"], nasty);
    assert!(html.contains("&lt;/script&gt;&lt;script&gt;alert(&#39;&quot;&amp;1&#39;)"));
    // Values that look like names of places are values.
    assert_eq!(filled("<a>{{x}}</a>{{y}}", &[("x", "{{y}}"), ("y", "1")]), "<a>{{y}}</a>1");
}

#[test]
fn pages_keep_their_size() {
    // 202 500 points, more than are shown, with random heights and distances.
    let mut page = page(450);
    page.parts[0].surface = Surface::default();
    let html = page.to_html();
    let data: serde_json::Value = serde_json::from_str(element(&html, "data")).unwrap();
    let count = |name: &str| {
        data["sections"].as_array().unwrap().iter().find(|s| s["name"] == name).unwrap()["count"].as_u64().unwrap()
            as usize
    };
    assert_eq!(count("0.points"), MOST_POINTS);
    let most = MOST_BYTES + MOST_BYTES_A_POINT * (count("0.points") + count("0.vertices"));
    assert!(html.len() <= most, "{} of {most}", html.len());
}

#[test]
fn empty_and_flat_parts_have_pages() {
    let html = Page::default().to_html();
    let data: serde_json::Value = serde_json::from_str(element(&html, "data")).unwrap();
    assert_eq!(data["parts"], serde_json::json!([]));
    let mut one = page(4);
    one.parts[0].scan = Scan { points: vec![[1.0, 2.0, 3.0]], deviations: vec![0.0], ..Scan::default() };
    one.parts[0].surface = Surface::default();
    one.parts.push(Part::default());
    let html = one.to_html();
    let data: serde_json::Value = serde_json::from_str(element(&html, "data")).unwrap();
    assert_eq!(data["lower"], data["upper"]);
}

#[test]
fn triangles_follow_their_points() {
    assert_eq!(renumbered(&[[0, 1, 2], [3, 2, 1]], &[2, 3, 0, 1]), [[0, 2, 3], [0, 3, 1]]);
}
