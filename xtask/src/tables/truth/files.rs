//! The scans of the table, by their names in the folder that is given.

/// Scans of one kind, with a heading.
pub(super) struct Kind {
    pub(super) heading: &'static str,
    pub(super) files: &'static [&'static str],
}

/// Scans with parameters outside of the unit square.
pub(super) const OWN_DOMAINS: [&str; 1] = ["deepdrawingC.xml"];

/// Scans of a surface that passes through itself.
pub(super) const CROSSING: [&str; 4] =
    ["thbs_face_grid.csv", "thbs_face_random.csv", "thbs_face_random.xyz", "thesis/nefertiti_up.xml"];

/// Every scan of one surface.
pub(super) const KINDS: [Kind; 6] = [
    Kind {
        heading: "Meshes",
        files: &[
            "nefertiti_299.off",
            "nefertiti_face_532.obj",
            "nefertiti_face_2040.obj",
            "nefertiti_head_8933.obj",
            "fran_face_scan.ply",
            "humface_raw.ply",
            "dtc_hull_half.ply",
            "beetle_shell.ply",
            "beetle_bonnet.obj",
            "solids/patch-01.off",
            "solids/blob.off",
            "solids/mech-holes-shark.off",
        ],
    },
    Kind {
        heading: "Points of meshes",
        files: &[
            "nefertiti_299.xyz",
            "nefertiti_face_532.xyz",
            "nefertiti_face_2040.xyz",
            "nefertiti_head_8933.xyz",
            "fran_face_scan.xyz",
            "humface_raw.xyz",
            "dtc_hull_half.xyz",
            "beetle_shell.xyz",
            "beetle_bonnet.xyz",
        ],
    },
    Kind {
        heading: "Grids and points sampled from surfaces",
        files: &[
            "iea15_blade_grid.csv",
            "iea15_blade.xyz",
            "thbs_face_grid.csv",
            "thbs_face_random.csv",
            "thbs_face_random.xyz",
            "peaks_10k.csv",
            "deepdrawingC.xml",
        ],
    },
    Kind {
        heading: "Heights",
        files: &[
            "sthelens.asc",
            "sthelens_crater.xyz",
            "jacksboro_fault.asc",
            "topography_lidar_ground.xyz",
            "canopy_lidar.csv",
        ],
    },
    Kind {
        heading: "Clouds of the thesis",
        files: &[
            "thesis/shiphull_v200_scalePts.xml",
            "thesis/shipHull_v1000_scattered.xml",
            "thesis/shiphull_scalePts.xml",
            "thesis/shiphull_cen.xml",
            "thesis/shiphull_chl.xml",
            "thesis/car_v1000.xml",
            "thesis/car2.xml",
            "thesis/car2_cen.xml",
            "thesis/face_v9000.xml",
            "thesis/nefertiti_up.xml",
            "thesis/nefertiti_v9000_boundary_correction.xml",
        ],
    },
    Kind {
        heading: "Views from one side, shapes with noise",
        files: &[
            "views/anchor_view.ply",
            "views/bear_view.ply",
            "views/halfcyl.xyz",
            "views/fullcyl.xyz",
            "views/ridge90.xyz",
        ],
    },
];
