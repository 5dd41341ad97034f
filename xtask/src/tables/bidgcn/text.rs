//! Words around the tables.

use super::{BidgcnTables, Networks};

pub(super) fn introduction(options: &BidgcnTables<'_>, networks: &Networks) -> String {
    let data = if options.data.is_some() { " --data DIR" } else { "" };
    let train = options.train.map_or(String::new(), |steps| format!(" --train {steps}"));
    let note =
        |notes: &std::collections::BTreeMap<String, String>, name: &str| notes.get(name).cloned().unwrap_or_default();
    format!(
        "# Learned parameterization of scattered clouds: BIDGCN\n\n    \
         RAYON_NUM_THREADS=1 cargo xtask tables bidgcn --clouds {}{data}{train}\n\n\
         computes this page anew, from seed {}. Figures 4.24 and 4.26 to 4.31 of Imperatore 2024 are curves without printed \
         numbers; these are the tables to them.\n\n\
         MSE is the mean squared distance of the points to the Bézier patch of least squares at their parameters, the three \
         coordinates summed, in the unit cube; means over {} clouds a cell, the same for all methods (the figures have 100). \
         Times are seconds or milliseconds of one processor core and do not include the fit. UNIF, RECD and LPSP: radius \
         3/√m (4.16), grown where it ties too few points. PARGCN and BIDGCN are the networks that come with `param-nn`, \
         trained in {} and {} steps; PARGCN without its correction, radius 0.2 √(264/m), at most 32 neighbours.\n",
        options.clouds,
        super::synthetic::SEED,
        options.clouds,
        note(networks.pargcn.notes(), "steps_done"),
        note(networks.bidgcn.notes(), "steps_done"),
    )
}

pub(super) const BEFORE_ERRORS: &str = "
## Errors

Points inside and on the boundary of a random patch (Imperatore 2024, §4.3.4), its true boundary parameters given; noise with
a standard deviation in each coordinate before scaling. \"And 2 joint steps\": two steps of the joint Levenberg–Marquardt
method of `moving-param` for control points and parameters, which the thesis does not have here; factors against LPSP
without them. \"BIDGCN, averaged\" reads each cloud in the eight positions of the square and takes the mean; clouds of at most 300 points
inside it reads with the midpoints of their Gabriel graph (`Reading::BEST`). It is the same network.
";

pub(super) fn caption(degree: usize, noise: f64) -> String {
    match noise {
        0.0 => format!("Degree {degree}:"),
        _ => format!("Degree {degree}, noise {noise:.0e}:"),
    }
}

pub(super) const BEFORE_MEDIANS: &str = "
Medians over the clouds, and on how many the network is below LPSP, degree 2:

";

pub(super) const BEFORE_TIMES: &str = "
## Times

Milliseconds of one core for a cloud of degree 2 without noise.

";

pub(super) fn before_shares(clouds: u64) -> String {
    format!(
        "\n## Clouds parameterized at noise 5e-2\n\nOf {clouds}, degree 2; in brackets, those for which the radius 3/√m was \
         enough (Figure 4.27, left).\n"
    )
}

pub(super) fn before_trained(steps: u64, rate: f64, seed: u64) -> String {
    format!(
        "\n## The published form, and the ablation\n\nTrained for this table in {steps} steps each, rate {rate}, seed {seed}, \
         on the same mixed clouds: a small part of what the shipped network got, so only these four compare. \"As shipped\" \
         turns points into the frame of the boundary, \"plain\" does not. DGCNN has an input layer that knows nothing of the \
         boundary but, where not plain, its frame. Nothing else differs: the published recipe, `cargo xtask train bidgcn --recipe \
         published`, has other clouds, another optimizer and no distance from true parameters in its loss. Degree 2:\n\n"
    )
}

pub(super) const BEFORE_REAL: &str = "
## Real clouds

All methods get the same boundary parameters: those of the file (clouds of the authors, in the repository of G+Smo), or chord
length between four corners that are found (meshes of Nefertiti). Folded triangles are counted on the mesh, or on the triangles
that the parameters of the file span. The second fit is a biquadratic B-spline of 16 × 16 elements, without smoothing where
that determines it. The networks read all points at once.

";

pub(super) const BEFORE_MOVING: &str = "
## Adaptive fits with moving parameters

Example 5.2.2 (c) and (d) of Imperatore 2024: A-PDM from one element, eight iterations with one correction of the parameters each,
λ = 1e-6, hierarchical splines of degree 2 (Nefertiti) and 3 (face). The tolerance is chosen by bisection such that the number of
control points is within 2 % of the printed one, or as near as nine trials come. Points are in the unit cube.

";

pub(super) const AFTER_MOVING: &str = "
Printed: (d), on a cloud of as many points, LPSP 5672 control points, MSE 5.50e-6, MAX 3.34e-2, and BIDGCN 5404, 1.75e-6, 1.41e-2, a
factor of 0.32; (c), on a face of 9283 points that is not public, BIDGCN 2687, 1.45e-8, 1.03e-3, without LPSP beside it.
";

pub(super) const BEFORE_GUARDED: &str = "
## A guarded second opinion

What `thb fit CLOUD --tol 0.5% --method ls --mark threshold` makes of clouds without triangles or parameters, without and with `--networks on`. The networks
are asked for the parameters of all points (where the classical map has folds) and of 2000 well-spread ones, which a smooth map
of the square carries to all; of these, and of points half and a quarter of the way to them, the best is taken that folds no
more triangles than the classical map, if its coarse quick fit is no worse, its fine one leaves at most 0.9 of the error, and no
larger void appears; a fine fit has at most 32 × 32 elements, a coarse one half as many. Ratios are those of the best candidate's errors to the classical ones; a dash: all fold more. The clouds
are those of the table above and raw scans. Seconds of one core are for the whole fit.
";
