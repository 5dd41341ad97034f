//! Tests of the network against its definition edge by edge, and of its gradient against differences.

use super::*;
use crate::bidgcn::layout::Variant;
use crate::synthetic::{ControlPoints, ScatteredSpec, stream};
use rand::RngExt;

/// A cloud with an interior point that no boundary point reaches.
fn input<T: Real>(interior: usize) -> Input<T> {
    let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior, noise: 0.0 };
    let cloud = spec.sample(&mut stream(11, 0)).unwrap();
    let all: Vec<[f64; 3]> = cloud.points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
    let uv: Vec<[f64; 2]> = cloud.parameters.rows().into_iter().map(|u| [u[0], u[1]]).collect();
    Input::new(&all[..interior], &all[interior..], &uv[interior..], Neighbours::default())
}

fn weights(layout: &Layout) -> Vec<f64> {
    let mut random = stream(12, 0);
    let mut theta = vec![0.0; layout.len()];
    for slot in layout.slots() {
        let bound = slot.fan_in.map_or(0.3, |fan_in| 1.0 / (fan_in as f64).sqrt());
        let gamma = slot.range.start..slot.range.start + slot.shape[1];
        for place in slot.range.clone() {
            let one = if slot.fan_in.is_none() && gamma.contains(&place) { 1.0 } else { 0.0 };
            theta[place] = one + bound * (2.0 * random.random::<f64>() - 1.0);
        }
    }
    theta
}

/// The layers as the text states them: a message for every edge, then means. Row-major, f64, loops only.
mod naive {
    use super::*;

    type Rows = Vec<Vec<f64>>;

    fn linear(x: &Rows, theta: &[f64], weights: &std::ops::Range<usize>, bias: &std::ops::Range<usize>) -> Rows {
        let (w, b) = (&theta[weights.clone()], &theta[bias.clone()]);
        let row = |x: &Vec<f64>| {
            assert_eq!(x.len() * b.len(), w.len());
            (0..b.len()).map(|o| b[o] + (0..x.len()).map(|i| x[i] * w[i * b.len() + o]).sum::<f64>()).collect()
        };
        x.iter().map(row).collect()
    }

    fn norm_relu(x: &Rows, theta: &[f64], norm: &std::ops::Range<usize>) -> Rows {
        let width = norm.len() / 2;
        let count = x.len() as f64;
        let mean = |k: usize| x.iter().map(|r| r[k]).sum::<f64>() / count;
        let means: Vec<f64> = (0..width).map(mean).collect();
        let variance = |k: usize| x.iter().map(|r| (r[k] - means[k]).powi(2)).sum::<f64>() / count;
        let deviations: Vec<f64> = (0..width).map(|k| (variance(k) + 1e-5).sqrt()).collect();
        let one =
            |k: usize, x: f64| theta[norm.start + k] * (x - means[k]) / deviations[k] + theta[norm.start + width + k];
        x.iter().map(|r| r.iter().enumerate().map(|(k, x)| one(k, *x).max(0.0)).collect()).collect()
    }

    fn chunks(x: &[f64], width: usize) -> Rows {
        x.chunks_exact(width).map(<[f64]>::to_vec).collect()
    }

    /// Means of edge messages; zeros without an edge.
    fn aggregate(graph: &Graph, messages: &Rows, width: usize) -> Rows {
        let mut next = 0;
        (0..graph.targets())
            .map(|i| {
                let count = graph.of(i).len();
                let part = &messages[next..next + count];
                next += count;
                (0..width).map(|k| part.iter().map(|m| m[k]).sum::<f64>() / count.max(1) as f64).collect()
            })
            .collect()
    }

    fn edges(graph: &Graph, targets: &Rows, sources: &Rows, width: usize) -> Rows {
        let mut rows = Vec::new();
        for (i, x) in targets.iter().enumerate() {
            for &j in graph.of(i) {
                let y = &sources[j as usize];
                let mut row = x.clone();
                row.extend((0..width).map(|k| y[k] - x[k]));
                row.extend(&y[width..]);
                rows.push(row);
            }
        }
        rows
    }

    /// Biases of the layers before a normalization, which the fast form leaves out.
    pub(super) fn logits(layout: &Layout, theta: &[f64], input: &Input<f64>, graphs: &[Graph]) -> Vec<f64> {
        let named = |name: &str| layout.slots().iter().find(|s| s.name == name).unwrap().range.clone();
        let interior = chunks(&input.interior, 3);
        let mut x = vec![vec![0.0; WIDTH]; input.len()];
        for (kind, graph, sources) in [
            ("interior", &input.interior_graph, &interior),
            ("boundary", &input.boundary_graph, &chunks(&input.boundary, 5)),
        ] {
            let name = |part: &str| named(&format!("input.{kind}.{part}"));
            if !layout.slots().iter().any(|s| s.name.contains(kind)) {
                continue;
            }
            let edges = edges(graph, &interior, sources, 3);
            let hidden = linear(&edges, theta, &name("1.weight"), &name("1.bias"));
            let hidden = norm_relu(&hidden, theta, &name("1.norm"));
            let messages = linear(&hidden, theta, &name("2.weight"), &name("2.bias"));
            for (x, mean) in x.iter_mut().zip(aggregate(graph, &messages, WIDTH)) {
                x.iter_mut().zip(mean).for_each(|(x, m)| *x += m);
            }
        }
        let positive =
            |rows: Rows| -> Rows { rows.into_iter().map(|r| r.into_iter().map(|x| x.max(0.0)).collect()).collect() };
        let mut features = vec![positive(x)];
        for k in 0..HIDDEN {
            let x = &features[k];
            let edges = edges(&graphs[k], x, x, WIDTH);
            let name = |part: &str| named(&format!("hidden.{}.{part}", k + 1));
            let messages = linear(&edges, theta, &name("weight"), &name("bias"));
            let y = aggregate(&graphs[k], &messages, WIDTH);
            features.push(if k + 1 < HIDDEN { positive(y) } else { y });
        }
        let mut y: Rows = (0..input.len()).map(|i| features.iter().flat_map(|f| f[i].clone()).collect()).collect();
        for k in 1..=3 {
            let name = |part: &str| named(&format!("output.{k}.{part}"));
            y = linear(&y, theta, &name("weight"), &name("bias"));
            if k < 3 {
                y = norm_relu(&y, theta, &name("norm"));
            }
        }
        y.into_iter().flatten().collect()
    }
}

#[test]
fn the_collapsed_form_equals_a_message_for_every_edge() {
    for variant in [Variant::Bidgcn, Variant::Dgcnn] {
        let layout = Layout::new(variant);
        let theta = weights(&layout);
        let exact = input::<f64>(120);
        assert!((0..120).any(|i| exact.boundary_graph.of(i).is_empty()), "no point is far from the boundary");
        assert!((0..120).any(|i| exact.boundary_graph.of(i).len() > 1), "no point is near the boundary");
        let (logits, tape) = forward(&layout, &theta, &exact, None);
        let edges: usize = tape.graphs.iter().map(Graph::edges).sum();
        assert!(edges > 5 * 120, "the hidden graphs hold {edges} edges: too few to prove anything");
        let naive = naive::logits(&layout, &theta, &exact, &tape.graphs);
        let distance = |a: &[f64]| naive.iter().zip(a).fold(0.0f64, |d, (a, b)| d.max((a - b).abs()));
        assert!(distance(&logits) < 1e-11, "{variant:?} f64: {}", distance(&logits));
        let single: Vec<f32> = theta.iter().map(|&x| x as f32).collect();
        let (logits, _) = forward(&layout, &single, &input::<f32>(120), Some(&tape.graphs));
        let logits: Vec<f64> = logits.into_iter().map(f64::from).collect();
        assert!(distance(&logits) < 1e-4, "{variant:?} f32: {}", distance(&logits));
    }
}

#[test]
fn gradients_agree_with_differences_in_every_tensor() {
    let layout = Layout::new(Variant::Bidgcn);
    let mut theta = weights(&layout);
    let input = input::<f64>(60);
    let (logits, tape) = forward(&layout, &theta, &input, None);
    let directions: Vec<f64> = (0..logits.len()).map(|k| (1.7 * k as f64).cos()).collect();
    let gradient = backward(&layout, &theta, &input, &tape, &directions);
    let scale = gradient.iter().fold(0.0f64, |s, g| s.max(g.abs()));
    let value = |theta: &[f64]| -> f64 {
        let (logits, _) = forward(&layout, theta, &input, Some(&tape.graphs));
        logits.iter().zip(&directions).map(|(a, b)| a * b).sum()
    };
    let mut random = stream(13, 0);
    for slot in layout.slots() {
        for _ in 0..3 {
            let place = random.random_range(slot.range.clone());
            if !slot.active {
                assert_eq!(gradient[place], 0.0, "{}", slot.name);
            }
            let (kept, h) = (theta[place], 1e-6);
            theta[place] = kept + h;
            let after = value(&theta);
            theta[place] = kept - h;
            let difference = (after - value(&theta)) / (2.0 * h);
            theta[place] = kept;
            let error = (difference - gradient[place]).abs();
            assert!(error < 1e-6 * scale, "{} {place}: {difference} against {}", slot.name, gradient[place]);
        }
    }
}

#[test]
fn graphs_of_the_embedded_networks_features_hold_the_nearest_points() {
    let network = crate::Bidgcn::embedded().unwrap();
    let n = 1500;
    let input = input::<f32>(n);
    let (_, tape) = forward(&network.layout, &network.theta, &input, None);
    let mut equal = 0;
    for (graph, features) in tape.graphs.iter().zip(&tape.features) {
        let rows = rows(features);
        let squared = |a: &[f32; WIDTH], b: &[f32; WIDTH]| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from(a - b) * f64::from(a - b)).sum()
        };
        let largest = rows.iter().map(|row| squared(row, &[0.0; WIDTH])).fold(0.0, f64::max);
        // Round-off of distances that are formed from squares, in single precision.
        let (limit, round_off) = (f64::from(RADIUS * RADIUS), 1e-6 * largest);
        for (i, row) in rows.iter().enumerate() {
            let mut all: Vec<f64> = rows.iter().map(|other| squared(row, other)).collect();
            let mut found: Vec<f64> = graph.of(i).iter().map(|&j| all[j as usize]).collect();
            all.sort_unstable_by(f64::total_cmp);
            found.sort_unstable_by(f64::total_cmp);
            let certain = all.iter().filter(|d| **d < limit - round_off).count().min(CAP);
            assert!(found.len() >= certain && found.len() <= CAP, "{} of {certain}", found.len());
            assert!(found.iter().all(|d| *d < limit + round_off));
            for (found, brute) in found.iter().zip(&all) {
                assert!((found - brute).abs() <= round_off, "{found} {brute} {round_off}");
            }
            equal += usize::from(all[1] == 0.0);
            let mut sources = graph.of(i).to_vec();
            sources.sort_unstable();
            sources.dedup();
            assert_eq!(sources.len(), found.len(), "a source twice");
        }
    }
    assert!(equal > n, "{equal} rows have an equal one: too few to prove anything");
}
