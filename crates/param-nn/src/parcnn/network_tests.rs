//! Gradients against differences, and what a row sees.

use super::*;
use crate::parcnn::layout::{Architecture, SHIPPED_FORM};
use crate::synthetic::{normal, stream};

fn check_gradient(architecture: Architecture, rows: Rows) {
    let layout = Layout::new(architecture);
    let mut random = stream(5, 0);
    let theta: Vec<f64> = (0..layout.len()).map(|_| 0.2 * normal(&mut random)).collect();
    let inputs = layout.convolutions[0].inputs;
    let input: Vec<f64> = (0..rows.count() * inputs).map(|_| normal(&mut random)).collect();
    let outputs = match architecture.form {
        Form::Published { .. } => architecture.directions,
        Form::Feedback { .. } => 1,
    };
    let given: Vec<f64> = (0..rows.count() * outputs).map(|_| normal(&mut random)).collect();
    let value = |theta: &[f64]| -> f64 {
        let y = forward(&layout, theta, input.clone(), rows, Keep::Everything).0;
        assert_eq!(y.len(), given.len());
        y.iter().zip(&given).map(|(y, g)| y * g).sum()
    };
    let tape = forward(&layout, &theta, input.clone(), rows, Keep::Everything).1;
    let gradient = backward(&layout, &theta, &tape, rows, &given);
    for slot in layout.slots() {
        // One direction in each tensor, so that no tensor hides behind another.
        let part = &gradient[slot.range.clone()];
        let norm = part.iter().map(|g| g * g).sum::<f64>().sqrt();
        assert!(norm > 0.0, "{}", slot.name);
        let moved = |h: f64| {
            let mut theta = theta.clone();
            theta[slot.range.clone()].iter_mut().zip(part).for_each(|(t, g)| *t += h * g / norm);
            value(&theta)
        };
        let h = 1e-5;
        let difference = (moved(h) - moved(-h)) / (2.0 * h);
        assert!((difference / norm - 1.0).abs() < 1e-6, "{}: {difference} against {norm}", slot.name);
    }
}

#[test]
fn gradients_agree_with_differences() {
    let small = Form::Feedback { blocks: 3, width: 8 };
    check_gradient(Architecture { dimension: 2, directions: 1, form: small }, Rows { groups: 3, lines: 1, places: 7 });
    check_gradient(Architecture { dimension: 3, directions: 2, form: small }, Rows { groups: 2, lines: 3, places: 5 });
    let published = Form::Published { degree: 2, blocks: 2, width: 6 };
    check_gradient(
        Architecture { dimension: 2, directions: 1, form: published },
        Rows { groups: 3, lines: 1, places: 4 },
    );
    check_gradient(
        Architecture { dimension: 3, directions: 2, form: published },
        Rows { groups: 2, lines: 4, places: 5 },
    );
}

#[test]
fn groups_do_not_see_each_other() {
    let layout = Layout::new(Architecture { dimension: 3, directions: 2, form: SHIPPED_FORM });
    let mut random = stream(6, 0);
    let theta: Vec<f64> = (0..layout.len()).map(|_| 0.1 * normal(&mut random)).collect();
    let (one, two) = (Rows { groups: 1, lines: 4, places: 9 }, Rows { groups: 2, lines: 4, places: 9 });
    let inputs = layout.convolutions[0].inputs;
    let input: Vec<f64> = (0..two.count() * inputs).map(|_| normal(&mut random)).collect();
    let together = forward(&layout, &theta, input.clone(), two, Keep::Everything).0;
    for (part, y) in input.chunks_exact(one.count() * inputs).zip(together.chunks_exact(one.count())) {
        let alone = forward(&layout, &theta, part.to_vec(), one, Keep::Nothing).0;
        assert!(alone.iter().zip(y).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}

#[test]
fn outside_a_line_its_ends_count_again() {
    let rows = Rows { groups: 2, lines: 2, places: 3 };
    // Group 1, line 0, place 1.
    let row = 7;
    assert_eq!([-5, -1, 0, 1, 9].map(|b| rows.source(row, [0, b])), [6, 6, 7, 8, 8]);
    assert_eq!([-1, 1, 2].map(|a| rows.source(row, [a, 0])), [7, 10, 10]);
}
