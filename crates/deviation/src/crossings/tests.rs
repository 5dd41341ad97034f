//! Planted crossings.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use thb_core::SplineMap;

use super::*;
use crate::testing::{Random, interpolated, moved, refined_at_random};

fn extent_of(map: &SplineMap<2>) -> f64 {
    let rows: Vec<[f64; 3]> = map.coefficients().outer_iter().map(|r| [r[0], r[1], r[2]]).collect();
    Extent::of(&rows).diagonal()
}

/// The crossings of a surface, found with a chord error that is a share of its size.
fn crossings(map: &SplineMap<2>, share: f64, least_share: f64) -> Crossings {
    let size = extent_of(map);
    let tessellation = Tessellation::new(map, share * size, 1_000_000).unwrap();
    let found = self_crossings(&[TessellatedPatch { map, tessellation: &tessellation }], least_share * size).unwrap();
    assert!(found.complete);
    // Both parameters of a place lead there.
    for crossing in &found.places {
        for u in crossing.parameters {
            let there = map.eval(u).unwrap();
            let off = norm(sub([there[0], there[1], there[2]], crossing.place));
            assert!(off <= 3.0 * share * size, "{off} {crossing:?}");
        }
    }
    found
}

/// Shares of the size that are tried as chord errors.
const SHARES: [f64; 3] = [2e-3, 3e-4, 5e-5];

#[test]
fn a_swept_lemniscate_crosses_itself_along_a_line() {
    let mut random = Random::new(1);
    for case in 0..12 {
        // (sin t, sin 2t / 2) is at 0 for t = 0 and t = π.
        let (reach, height, slope) = (random.between(0.2, 1.2), random.between(0.2, 3.0), random.between(-0.5, 0.5));
        let shape = |u: f64, v: f64| {
            let t = -reach + u * (PI + 2.0 * reach);
            [t.sin() + slope * v, 0.5 * (2.0 * t).sin(), height * v]
        };
        let mut map = interpolated([24, 3], [false, false], shape);
        for _ in 0..case % 3 {
            map = refined_at_random(&map, &mut random);
        }
        let (map, motion) = moved(&map, &mut random);
        let size = extent_of(&map);
        for share in SHARES {
            let found = crossings(&map, share, 0.0);
            assert_eq!(found.places.len(), 1, "case {case}, share {share}: {found:?}");
            let place = &found.places[0];
            let (from, to) = (motion([0.0; 3]), motion([slope, 0.0, height]));
            let axis = unit(sub(to, from));
            let way = sub(place.place, from);
            let off = norm(sub(way, scale(dot(way, axis), axis)));
            assert!(off < 1e-3 * size, "{off} of {size}");
            assert!(
                (place.extent - norm(sub(to, from))).abs() < 0.02 * size,
                "{} {}",
                place.extent,
                norm(sub(to, from))
            );
            let [a, b] = place.parameters.map(|u| -reach + u[0] * (PI + 2.0 * reach));
            assert!((a.min(b) - 0.0).abs() < 0.02 && (a.max(b) - PI).abs() < 0.02, "{a} {b}");
        }
    }
}

#[test]
fn a_tube_whose_wall_is_pushed_through_the_other_wall_crosses_itself_there() {
    let mut random = Random::new(2);
    for case in 0..10 {
        let (at, width) = ([random.between(0.0, 1.0), random.between(0.35, 0.65)], random.between(0.09, 0.13));
        // The wall at `at` moves inward by this many radii: from 2 on it reaches the other side.
        let push = |depth: f64| {
            move |u: f64, v: f64| {
                let round = (u - at[0] + 0.5).rem_euclid(1.0) - 0.5;
                let bump = depth * (-(round / width).powi(2) - (2.0 * (v - at[1]) / width).powi(2)).exp();
                let (sin, cos) = (TAU * u).sin_cos();
                let (inward_sin, inward_cos) = (TAU * at[0]).sin_cos();
                [cos - bump * inward_cos, sin - bump * inward_sin, 6.0 * v]
            }
        };
        for (depth, crosses) in [(0.0, false), (1.0, false), (1.8, false), (2.4, true), (3.0, true)] {
            let mut map = interpolated([32, 32], [true, false], push(depth));
            if case % 2 == 1 {
                map = refined_at_random(&map, &mut random);
            }
            let (map, motion) = moved(&map, &mut random);
            let found = crossings(&map, 3e-4, 0.0);
            assert_eq!(found.places.len(), usize::from(crosses), "case {case}, depth {depth}: {found:?}");
            if let Some(place) = found.places.first() {
                // On the wall opposite to the bump, where this is as deep as the tube is wide.
                let (sin, cos) = (TAU * at[0]).sin_cos();
                let opposite = motion([-cos, -sin, 6.0 * at[1]]);
                let off = norm(sub(place.place, opposite)) / extent_of(&map);
                assert!(off < 0.5 / 6.0, "{off} {place:?}");
                assert!(place.extent > 0.05 * extent_of(&map), "{place:?}");
            }
        }
    }
}

#[test]
fn a_bent_tube_crosses_itself_where_its_arms_do() {
    let mut random = Random::new(3);
    for case in 0..6 {
        // A tube round a lemniscate, whose arms meet at the origin; the middle lies apart by 2 h there.
        let radius = random.between(0.08, 0.16);
        let tube = |h: f64| {
            move |u: f64, v: f64| {
                let t = -0.9 + v * (PI + 1.8);
                let (tangent, at) = ([t.cos(), (2.0 * t).cos()], [t.sin(), 0.5 * (2.0 * t).sin(), h * t.cos()]);
                let length = tangent[0].hypot(tangent[1]);
                let (sin, cos) = (TAU * u).sin_cos();
                let side = [-tangent[1] / length, tangent[0] / length];
                [at[0] + radius * cos * side[0], at[1] + radius * cos * side[1], at[2] + radius * sin]
            }
        };
        for (h, crosses) in [(0.0, true), (0.7 * radius, true), (1.2 * radius, false)] {
            let (map, motion) = moved(&interpolated([16, 40], [true, false], tube(h)), &mut random);
            let found = crossings(&map, 2e-4, 0.0);
            assert_eq!(!found.places.is_empty(), crosses, "case {case}, {h}: {found:?}");
            for place in &found.places {
                let off =
                    norm(sub(place.place, motion([0.0; 3]))) / norm(sub(motion([1.0, 0.0, 0.0]), motion([0.0; 3])));
                assert!(off < 2.5 * radius, "{off} {radius}");
            }
        }
    }
}

#[test]
fn a_loop_that_opens_in_the_middle_of_a_sheet_is_found_where_it_meets_itself() {
    let mut random = Random::new(4);
    for case in 0..8 {
        // A trochoid near v = ½, a straight line far from there; symmetric in u about ½. It has a loop where 10 · lean > 1.
        let wide = random.between(2.0, 5.0);
        let wave = |lean: f64| {
            move |u: f64, v: f64| {
                let strength = (-(wide * (v - 0.5)).powi(2) - (3.0 * (u - 0.5)).powi(2)).exp();
                let (sin, cos) = (10.0 * (u - 0.5)).sin_cos();
                [u - lean * strength * sin, v, 0.3 * strength * cos]
            }
        };
        for (lean, crosses) in [(0.0, false), (0.05, false), (0.09, false), (0.14, true), (0.2, true)] {
            let mut map = interpolated([40, 16], [false, false], wave(lean));
            if case % 2 == 1 {
                map = refined_at_random(&map, &mut random);
            }
            let (map, motion) = moved(&map, &mut random);
            let found = crossings(&map, 2e-4, 0.0);
            assert_eq!(found.places.len(), usize::from(crosses), "case {case}, lean {lean}: {found:?}");
            for place in &found.places {
                let [a, b] = place.parameters;
                assert!((a[0] + b[0] - 1.0).abs() < 0.01 && (a[1] - b[1]).abs() < 0.01, "{place:?}");
                let (middle, aside) = (motion([0.5, 0.0, 0.0]), motion([1.5, 0.0, 0.0]));
                let across = dot(sub(place.place, middle), unit(sub(aside, middle)));
                assert!(across.abs() < 2e-3 * extent_of(&map), "{across}");
            }
        }
    }
}

#[test]
fn graphs_do_not_cross() {
    let mut random = Random::new(5);
    for case in 0..16 {
        let waves: Vec<[f64; 4]> = (0..5)
            .map(|_| {
                [
                    random.between(0.0, 0.15),
                    random.between(-9.0, 9.0),
                    random.between(-9.0, 9.0),
                    random.between(0.0, 6.0),
                ]
            })
            .collect();
        let shape = |u: f64, v: f64| {
            [u, v, waves.iter().map(|[height, a, b, c]| height * (a * u + b * v + c).sin()).sum::<f64>()]
        };
        let mut map = interpolated([10, 10], [false, false], shape);
        for _ in 0..case % 4 {
            map = refined_at_random(&map, &mut random);
        }
        let (map, _) = moved(&map, &mut random);
        for share in [1e-2, 1e-3, 1e-4] {
            assert_eq!(crossings(&map, share, 0.0).places, [], "case {case}");
        }
    }
}

#[test]
fn tubes_spheres_and_cones_do_not_cross() {
    let mut random = Random::new(6);
    for case in 0..12 {
        let squeeze = random.between(0.05, 1.0);
        let twist = random.between(-2.0, 2.0);
        let tube = |u: f64, v: f64| {
            let (sin, cos) = (TAU * u + twist * v).sin_cos();
            [cos, squeeze * sin, 4.0 * v + 0.3 * (5.0 * v).sin()]
        };
        // Poles at both ends, where a whole side is one point.
        let sphere = |u: f64, v: f64| {
            let (sin, cos) = (TAU * u).sin_cos();
            let (height, width) = (PI * (v - 0.5)).sin_cos();
            [width * cos, width * squeeze * sin, height]
        };
        let cone = |u: f64, v: f64| {
            let (sin, cos) = (TAU * u).sin_cos();
            [v * cos, v * squeeze * sin, 3.0 * v]
        };
        // An open sheet round the same sphere: its sides touch along a meridian.
        let maps = [
            interpolated([12, 6], [true, false], tube),
            interpolated([12, 8], [true, false], sphere),
            interpolated([12, 8], [false, false], sphere),
            interpolated([12, 3], [true, false], cone),
        ];
        for (k, map) in maps.into_iter().enumerate() {
            let map = if case % 2 == 1 { refined_at_random(&map, &mut random) } else { map };
            let (map, _) = moved(&map, &mut random);
            for share in [3e-3, 2e-4] {
                assert_eq!(crossings(&map, share, 0.0).places, [], "case {case}, shape {k}, share {share}");
            }
        }
    }
}

#[test]
fn thin_blades_and_bands_that_nearly_touch_do_not_cross() {
    let mut random = Random::new(7);
    for case in 0..12 {
        // Below two chord errors the triangles of the sides pass through one another; the surface does not.
        let chords = [0.3, 1.0, 3.0, 10.0][case % 4];
        let share = random.between(1e-4, 1e-3);
        // A blade: thickness of some chord errors, round in front, sharp behind, curved and twisted.
        let (camber, twist) = (random.between(0.0, 0.2), random.between(0.0, 1.0));
        let thickness = chords * share * 3.0;
        let blade = |u: f64, v: f64| {
            let t = TAU * u;
            let x = 0.5 * (1.0 + t.cos());
            let y = camber * (1.0 - (2.0 * x - 1.0).powi(2)) + 0.65 * thickness * t.sin() * (0.5 * t).sin().abs();
            let (sin, cos) = (twist * v).sin_cos();
            [x * cos - y * sin, x * sin + y * cos, 3.0 * v]
        };
        // A band that is wound on itself once and a bit, with a gap of as much.
        let gap = chords * share;
        let band = |u: f64, v: f64| {
            let t = (TAU + FRAC_PI_2) * u;
            let r = 1.0 + gap * 3.0 * u;
            [r * t.cos(), r * t.sin(), v]
        };
        for (closed, map) in [
            (true, interpolated([64, 6], [true, false], blade)),
            (false, interpolated([64, 6], [false, false], blade)),
            (false, interpolated([48, 3], [false, false], band)),
        ] {
            let (map, _) = moved(&map, &mut random);
            let found = crossings(&map, share, 0.0);
            assert_eq!(found.places, [], "case {case}, closed {closed}, share {share}, chords {chords}");
        }
    }
}

#[test]
fn the_order_of_work_is_bounded_for_a_surface_that_is_one_heap() {
    let mut random = Random::new(8);
    let map = interpolated([60, 60], [false, false], |u, v| {
        let t = 4000.0 * u + 300.0 * v;
        [t.sin(), (1.7 * t).cos(), (0.3 * t + 90.0 * v).sin()]
    });
    let tessellation = Tessellation::new(&map, 1e-3, 60_000).unwrap();
    let found =
        self_crossings(&[TessellatedPatch { map: &map, tessellation: &tessellation }], random.between(0.0, 1e-6))
            .unwrap();
    assert!(found.pairs > 1000);
    // All in one point.
    let map = interpolated([30, 30], [false, false], |_, _| [1.0, 2.0, 3.0]);
    let tessellation = Tessellation::new(&map, 1e-3, 60_000).unwrap();
    let found = self_crossings(&[TessellatedPatch { map: &map, tessellation: &tessellation }], 0.0).unwrap();
    assert_eq!((found.pairs, found.complete), (0, true));
}

/// A patch over `(u, v) ↦ origin + u · first + v · second`, bent by `bend · sin(π u) sin(π v)` along z.
fn bent_patch(origin: [f64; 3], first: [f64; 3], second: [f64; 3], bend: f64) -> SplineMap<2> {
    interpolated([6, 6], [false, false], |u, v| {
        let flat = add(origin, add(scale(u, first), scale(v, second)));
        add(flat, [0.0, 0.0, bend * (PI * u).sin() * (PI * v).sin()])
    })
}

fn crossings_of_patches(maps: &[SplineMap<2>], chords: &[f64]) -> Crossings {
    let tessellations: Vec<Tessellation> =
        maps.iter().zip(chords).map(|(map, &chord)| Tessellation::new(map, chord, 100_000).unwrap()).collect();
    let patches = maps.iter().zip(&tessellations).map(|(map, tessellation)| TessellatedPatch { map, tessellation });
    self_crossings(&patches.collect::<Vec<_>>(), 0.0).unwrap()
}

#[test]
fn patches_cross_one_another_where_one_is_pushed_through_the_other() {
    let mut random = Random::new(5);
    for _ in 0..10 {
        let (gap, over) = (random.between(0.05, 0.3), random.between(0.05, 0.3));
        let lower = bent_patch([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], gap + over);
        let upper = bent_patch([0.0, 0.0, gap], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], 0.0);
        let aside = bent_patch([2.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.3);
        let found = crossings_of_patches(&[aside, lower, upper], &[1e-3; 3]);
        assert_eq!(found.places.len(), 1, "{found:?}");
        let place = &found.places[0];
        assert_eq!(place.patches, [1, 2]);
        assert!((place.place[2] - gap).abs() < 5e-3, "{place:?}");
        let [bulge, plane] = place.parameters;
        assert!(((gap + over) * (PI * bulge[0]).sin() * (PI * bulge[1]).sin() - gap).abs() < 0.02, "{place:?}");
        assert!((plane[0] - bulge[1]).abs() + (plane[1] - bulge[0]).abs() < 0.02, "{place:?}");
    }
}

#[test]
fn patches_that_meet_along_arcs_do_not_cross_however_their_triangles_divide_them() {
    // Two bulges side by side on one bulged arc, and a wall that stands on it.
    let mut random = Random::new(6);
    for _ in 0..10 {
        let bulge = random.between(0.05, 0.5);
        let rim = |t: f64| bulge * (PI * t).sin();
        let left = interpolated([7, 7], [false, false], |u, v| [u - 1.0, v, u * rim(v)]);
        let right = interpolated([7, 7], [false, false], |u, v| [u, v, (1.0 - u) * rim(v)]);
        let below = interpolated([7, 7], [false, false], |u, v| [0.2 * u * u, v, rim(v) - u]);
        let found = crossings_of_patches(&[left, right, below], &[1e-2, 1e-3, 3e-4]);
        assert_eq!(found.places, [], "{bulge}");
    }
}
