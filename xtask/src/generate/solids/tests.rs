//! Shapes of every kind, and meshes that are refused.

use std::sync::LazyLock;

use point_cloud::vec3::{cross, dot, norm, sub, unit};

use super::*;

/// Shapes of a kind that are looked at; a large one is left out, which is made of the same code.
fn some(kind: Kind) -> impl Iterator<Item = &'static Solid> {
    static ALL: LazyLock<Vec<Solid>> = LazyLock::new(|| {
        let numbers = |kind| if kind == Kind::Genus { vec![0, 1, 3, 6, 10] } else { (0..10).collect() };
        let of_kind = |kind| numbers(kind).into_iter().map(move |number| Solid::new(kind, number, 0).unwrap());
        Kind::ALL.into_iter().flat_map(of_kind).collect()
    });
    ALL.iter().filter(move |solid| solid.known.kind == kind)
}

#[test]
fn every_kind_is_closed_looks_outward_and_has_its_genus() {
    // `Solid::new` checks the mesh, and refuses one that is not so: see `what_is_not_closed_is_refused`.
    let mut found = std::collections::BTreeSet::new();
    for kind in Kind::ALL {
        for solid in some(kind) {
            let (volume, name) = (solid.part.volume(), &solid.known.name);
            assert!(volume > 0.0, "{name}: volume {volume}");
            found.insert((kind.name(), solid.known.genus));
        }
    }
    for genus in 1..=5 {
        assert!(found.contains(&("drilled", genus)), "no plate of genus {genus}");
        assert!(genus == 1 || genus == 5 || found.contains(&("genus", genus)), "nothing blended of genus {genus}");
    }
    assert!(found.contains(&("turned", 0)) && found.contains(&("turned", 1)));
}

#[test]
fn volumes_are_near_those_of_the_exact_shapes() {
    for kind in Kind::ALL {
        for Solid { part, known } in some(kind) {
            let Some(exact) = known.volume else {
                assert_eq!(kind, Kind::Genus);
                continue;
            };
            // Chords of n to a turn lose (2 π / n)² / 6 of an area; there are twelve and more.
            let error = part.volume() / exact - 1.0;
            assert!(error.abs() < 0.03, "{}: {} instead of {exact}, {error}", known.name, part.volume());
        }
    }
    // Without anything round it is exact, but for the decimals that are written.
    let Solid { part, known } = Solid::new(Kind::Box, 0, 0).unwrap();
    assert!((part.volume() / known.volume.unwrap() - 1.0).abs() < 1e-9);
}

#[test]
fn triangles_are_no_slivers() {
    for kind in Kind::ALL {
        for Solid { part, known } in some(kind) {
            let mut ratios: Vec<f64> = part
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| part.points[v]);
                    let sides = [sub(b, a), sub(c, b), sub(a, c)];
                    let longest = sides.map(norm).into_iter().fold(0.0, f64::max);
                    // Longest side over height, as a share of what an even triangle has.
                    longest * longest / norm(cross(sides[0], sides[1])) * 0.75_f64.sqrt()
                })
                .collect();
            ratios.sort_by(f64::total_cmp);
            let (most, p99) = (ratios[ratios.len() - 1], ratios[ratios.len() * 99 / 100]);
            assert!(p99 < 8.0 && most < 16.0, "{}: longest side over height {p99} (99 %), {most}", known.name);
        }
    }
}

#[test]
fn creases_are_the_sharp_edges() {
    for kind in Kind::ALL {
        for Solid { part, known } in some(kind) {
            let normal = |t: [usize; 3]| {
                let [a, b, c] = t.map(|v| part.points[v]);
                unit(cross(sub(b, a), sub(c, a)))
            };
            let mut owners: std::collections::BTreeMap<[usize; 2], Vec<[usize; 3]>> = std::collections::BTreeMap::new();
            for &t in &part.triangles {
                for k in 0..3 {
                    let (a, b) = (t[k], t[(k + 1) % 3]);
                    owners.entry([a.min(b), a.max(b)]).or_default().push(t);
                }
            }
            for (edge, two) in owners {
                let angle = dot(normal(two[0]), normal(two[1])).clamp(-1.0, 1.0).acos().to_degrees();
                if part.creases.contains(&edge) {
                    // Corners of profiles and outlines are right angles; chords of what is round take something away.
                    assert!((70.0..110.0).contains(&angle), "{}: {angle}° along the crease {edge:?}", known.name);
                } else {
                    assert!(angle < 45.0, "{}: {angle}° along {edge:?}, which is no crease", known.name);
                }
            }
            assert!(kind.is_sharp() || part.creases.is_empty());
        }
    }
}

#[test]
fn the_same_arguments_give_the_same_bytes_and_another_seed_others() {
    for kind in Kind::ALL {
        let bytes = |seed| {
            let part = Solid::new(kind, 1, seed).unwrap().part;
            Format::Off.mesh_bytes(&part.points, &part.triangles).unwrap()
        };
        assert_eq!(bytes(0), bytes(0));
        assert_ne!(bytes(0), bytes(1), "{kind:?}");
    }
}

#[test]
fn what_is_not_closed_is_refused() {
    let sphere = Solid::new(Kind::Round, 0, 0).unwrap().part;
    let refused = |change: &dyn Fn(&mut Part), genus: usize, what: &str| {
        let mut part = sphere.clone();
        change(&mut part);
        let error = part.checked(genus).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    };
    refused(&|part| part.triangles.truncate(part.triangles.len() - 1), 0, "0 times back");
    refused(&|_| {}, 1, "Euler");
    refused(&|part| part.triangles.iter_mut().for_each(|t| t.swap(0, 1)), 0, "inward");
    refused(&|part| part.creases.push([0, 0]), 0, "is no edge");
    let twice = |part: &mut Part| {
        let (count, copy) = (part.points.len(), part.clone());
        part.points.extend(copy.points);
        part.triangles.extend(copy.triangles.iter().map(|t| t.map(|v| v + count)));
    };
    refused(&twice, 0, "2 pieces");
    let touching = |part: &mut Part| {
        let (count, copy) = (part.points.len(), part.clone());
        part.points.extend(copy.points);
        part.triangles.extend(copy.triangles.iter().map(|t| t.map(|v| if v == 0 { 0 } else { v + count })));
        part.points.remove(count);
        part.triangles.iter_mut().flatten().for_each(|v| *v -= usize::from(*v > count));
    };
    refused(&touching, 0, "not one ring");
}

#[test]
fn files_are_written_with_what_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let known = write(folder.path(), &[Kind::Box, Kind::Torus], 2, 3, &mut |_| {}).unwrap();
    assert_eq!(known.len(), 4);
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    for Known { name, triangles, kind, creases, .. } in &known {
        let mesh = read(&format!("{name}.off"));
        let second = mesh.lines().nth(1).unwrap();
        assert_eq!(second.split(' ').nth(1).unwrap(), triangles.to_string());
        let path = folder.path().join(format!("{name}.creases"));
        assert_eq!(path.is_file(), *kind == Kind::Box);
        if path.is_file() {
            assert_eq!(read(&format!("{name}.creases")).lines().count(), *creases);
        }
    }
    let listed: serde_json::Value = serde_json::from_str(&read("solids.json")).unwrap();
    assert_eq!(listed[0]["name"], "box-01");
    assert_eq!(listed[0]["volume"], known[0].volume.unwrap());
}
