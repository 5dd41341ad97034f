//! Makes the layout of a mesh in OFF and writes it in the JSON form that `thb fit --layout FILE` reads:
//! `cargo run --release -p quad-layout --example layout_of -- PART.off [RADIUS] > part.layout.json`.

use std::io::Write as _;

use quad_layout::{BuildOptions, QuadLayout};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("PART.off is missing")?;
    let mut options = BuildOptions::default();
    if let Some(radius) = arguments.next() {
        options.radius = radius.parse()?;
    }
    let text = std::fs::read_to_string(&path)?;
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or(""));
    let mut words = lines.flat_map(str::split_whitespace).filter(|word| *word != "OFF");
    let mut number = || words.next().and_then(|word| word.parse::<f64>().ok()).ok_or("the file ends early");
    let (n, m) = (number()? as usize, number()? as usize);
    number()?;
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for _ in 0..n {
        points.push([number()?, number()?, number()?]);
    }
    for _ in 0..m {
        let corners: Vec<u32> =
            (0..number()? as usize).map(|_| number().map(|v| v as u32)).collect::<Result<_, _>>()?;
        triangles.extend((1..corners.len() - 1).map(|i| [corners[0], corners[i], corners[i + 1]]));
    }
    let layout = QuadLayout::of_mesh(&points, &triangles, &options)?;
    write(&layout)?;
    Ok(())
}

fn write(layout: &QuadLayout) -> std::io::Result<()> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let topology = layout.topology();
    let mut corners = vec![0; topology.n_vertices()];
    for (arc, ends) in topology.arcs().iter().enumerate() {
        let path = layout.path(arc);
        corners[ends[0] as usize] = path[0];
        corners[ends[1] as usize] = path[path.len() - 1];
    }
    let quads: Vec<String> = layout
        .patches()
        .iter()
        .enumerate()
        .map(|(number, patch)| {
            let paths: Vec<Vec<u32>> = (0..4)
                .map(|side| {
                    let on = topology.patches()[number][side];
                    let mut path = layout.path(on.arc as usize).to_vec();
                    if on.reversed {
                        path.reverse();
                    }
                    path
                })
                .collect();
            let at: Vec<u32> = (0..4).map(|k| topology.corner(number, k)).collect();
            let triangles: Vec<[u32; 3]> =
                patch.triangles.iter().map(|t| t.map(|v| patch.vertices[v as usize])).collect();
            format!(
                "{{\"corners\":{at:?},\"paths\":{paths:?},\"tri\":{triangles:?},\"vid\":{:?},\"uv\":{:?}}}",
                patch.vertices, patch.uv
            )
        })
        .collect();
    let vertices = layout.vertices();
    writeln!(out, "{{\"vertices\":{vertices:?},\"corners\":{corners:?},\"quads\":[{}]}}", quads.join(","))?;
    out.flush()
}
