//! What can go wrong between a file and its surface.

use std::path::PathBuf;

use geom_io::ReadError;
use point_cloud::CloudError;
use thiserror::Error;

use crate::hints;

/// Most pieces of which the sizes are listed.
const LISTED: usize = 8;

/// The pieces of a mesh, in words.
pub(crate) fn pieces_of(sizes: &[usize]) -> String {
    listed(sizes, "triangles")
}

fn point_pieces_of(sizes: &[usize]) -> String {
    listed(sizes, "points")
}

fn listed(sizes: &[usize], what: &str) -> String {
    let mut shown: Vec<String> = sizes.iter().take(LISTED).map(usize::to_string).collect();
    if sizes.len() > LISTED {
        shown.push("…".to_owned());
    }
    let pieces = if sizes.len() == 1 { "piece" } else { "pieces" };
    format!("{} {pieces} with [{}] {what}", sizes.len(), shown.join(", "))
}

/// The size of a piece, in words.
pub(crate) fn size_of_piece(size: usize, is_mesh: bool) -> String {
    format!("{size} {}", if is_mesh { "triangles" } else { "points" })
}

/// Errors of this crate.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A cloud or mesh could not be read.
    #[error("{error}{hint}", error = .0, hint = hints::of_reading(&.0.kind))]
    Read(ReadError),
    /// A mesh or report could not be written.
    #[error(transparent)]
    Write(#[from] geom_io::WriteError),
    /// A model could not be read or written.
    #[error(transparent)]
    Model(#[from] geom_io::ModelError),
    /// A surface could not be measured.
    #[error(transparent)]
    Deviation(#[from] deviation::Error),
    /// The points cannot be fitted, or the mesh is no disk.
    #[error("{error}{hint}", error = .0, hint = hints::of_cloud(.0))]
    Cloud(CloudError),
    /// No parameters could be found.
    #[error(transparent)]
    Parameterization(#[from] param_classic::ParamError),
    /// A network cannot parameterize the points.
    #[error(transparent)]
    Network(#[from] param_nn::NnError),
    /// The fit failed.
    #[error(transparent)]
    Fit(#[from] fit_ls::Error),
    /// The fit with moving parameters failed.
    #[error(transparent)]
    Moving(#[from] moving_param::Error),
    /// The spline space is not possible.
    #[error(transparent)]
    Space(#[from] thb_core::Error),
    /// A layout in patches cannot be used.
    #[error(transparent)]
    Layout(#[from] quad_layout::LayoutError),
    /// The fit of several patches failed.
    #[error(transparent)]
    Patches(#[from] multi_patch::Error),
    /// A layout was given for something without triangles.
    #[error("there are no triangles with an area; --layout needs a mesh")]
    NoTriangles,
    /// A patch of a layout names a corner that the file does not have.
    #[error("quad {patch} (counted from 0) of the layout has corner {corner}, but there are only {corners} corners")]
    LayoutCorner {
        /// The patch.
        patch: usize,
        /// The corner.
        corner: u32,
        /// Number of corners.
        corners: usize,
    },
    /// A layout lies elsewhere than the mesh.
    #[error(
        "{}: the layout fills the box from {:?} to {:?}, the mesh that from {:?} to {:?}; it must have the coordinates of the mesh, or \
         those in which the mesh's box has its centre at 0 and a diagonal of 1",
        path.display(), layout[0], layout[1], mesh[0], mesh[1]
    )]
    ForeignLayout {
        /// The file of the layout.
        path: PathBuf,
        /// Box of its vertices.
        layout: [[f64; 3]; 2],
        /// Box of the mesh.
        mesh: [[f64; 3]; 2],
    },
    /// An output of a whole part that is no STEP file.
    #[error("{}: surfaces of many faces are written to .step and .stp only", path.display())]
    SolidFormat {
        /// The output.
        path: PathBuf,
    },
    /// Points of a surface have three coordinates.
    #[error(
        "points have {given} coordinates; a surface needs x, y and z, which --columns names; thb fit-curve fits curves"
    )]
    Coordinates {
        /// Number of coordinates found.
        given: usize,
    },
    /// Parameters were asked for in a way that the input does not allow.
    #[error("--param {asked} needs {needed}, which the input does not have{hint}")]
    NoParameters {
        /// The parameterization asked for.
        asked: String,
        /// What it needs.
        needed: &'static str,
        /// What could be done.
        hint: &'static str,
    },
    /// A closed surface was asked for in a way that does not go round.
    #[error(
        "--closed {closed} needs a grid (columns i, j), parameters u, v in the file, or else --param auto, mean-value or uniform; \
         other parameters do not go round"
    )]
    NotClosed {
        /// The directions asked for.
        closed: String,
    },
    /// A cloud or mesh without order that closes in both directions.
    #[error(
        "--closed uv needs a grid (columns i, j) or parameters u, v in the file: clouds and meshes without order are laid out as \
         tubes, closed in u or in v; cut the surface open along one closed line"
    )]
    ClosedBothWays,
    /// Parameters of the file lie outside the unit square.
    #[error(
        "{} = {value} of {} lies outside [0, 1], u runs from {} to {} and v from {} to {}; if they are parameters, --domain data fits on \
         their box, where a fixed --lambda applies in their units; if they are pixels or the like, --param mean-value lays the \
         points out by their shape",
        ["u", "v"][usize::from(*direction != 0)],
        line.map_or_else(|| format!("point {index} (from 0)"), |line| format!("line {line}")),
        u.0, u.1, v.0, v.1
    )]
    OutsideUnitSquare {
        /// Index of the point, from 0.
        index: usize,
        /// Its line in the file, from 1, where that is text.
        line: Option<usize>,
        /// 0 for u, 1 for v.
        direction: usize,
        /// The parameter.
        value: f64,
        /// Least and greatest u.
        u: (f64, f64),
        /// Least and greatest v.
        v: (f64, f64),
    },
    /// A parameter to evaluate at lies outside the model's domain.
    #[error(
        "{}: {}: {name} = {value} lies outside the model's domain [{}, {}]",
        path.display(),
        line.map_or_else(|| format!("point {place} (from 0)"), |line| format!("line {line}")),
        domain[0], domain[1]
    )]
    EvalOutside {
        /// The file with the parameters.
        path: PathBuf,
        /// Its line in the file, from 1, where that is text.
        line: Option<usize>,
        /// Index of the row, from 0.
        place: usize,
        /// Name of the parameter.
        name: &'static str,
        /// The parameter.
        value: f64,
        /// Lower and upper end of the domain in this direction.
        domain: [f64; 2],
    },
    /// A parameter of a closed curve lies outside its period.
    #[error(
        "parameter {value} of point {index} lies outside [0, 1], the period of a closed curve; scale the parameters"
    )]
    OutsidePeriod {
        /// Index of the point, from 0.
        index: usize,
        /// The parameter.
        value: f64,
    },
    /// The parameters of a direction are all equal.
    #[error("all parameters of direction {direction} are {value}: the points lie on a line of the parameter domain")]
    FlatDomain {
        /// 0 for u, 1 for v.
        direction: usize,
        /// Their value.
        value: f64,
    },
    /// The parameters lie on a line of the domain.
    #[error(
        "the parameters of all {points} points lie on a line of the parameter domain: they spread {length:.3e} along it and {width:.1e} across, \
         and no surface is determined beside it; give points beside the line, leave out u, v or --height-field, or fit a curve (thb fit-curve)"
    )]
    LineDomain {
        /// Number of points.
        points: usize,
        /// Standard deviation of the parameters across the line.
        width: f64,
        /// Standard deviation along it.
        length: f64,
    },
    /// A mesh of several pieces, each too large to be stray.
    #[error(
        "the mesh has {}; --piece 1 fits the largest of them, --piece 2 the next, --piece all each for itself, --clean stray removes all but the largest",
        pieces_of(sizes)
    )]
    SeveralPieces {
        /// Triangles of each piece, largest first.
        sizes: Vec<usize>,
    },
    /// A piece was asked for that is not there.
    #[error("--piece {asked}: the {what} has {}; they are counted from 1, the largest first", if *what == "mesh" { pieces_of(sizes) } else { point_pieces_of(sizes) })]
    NoSuchPiece {
        /// The piece asked for, from 1.
        asked: usize,
        /// `mesh` or `cloud`.
        what: &'static str,
        /// Triangles or points of each piece, largest first.
        sizes: Vec<usize>,
    },
    /// A piece that was left when the run was interrupted.
    #[error("it was not begun: the run was interrupted")]
    NotBegun,
    /// A file that pieces need stands there as an input, or is written for another part.
    #[error("{}: this is an input or another output, and would be overwritten by that of a piece; choose another name for --output", path.display())]
    PieceOutput {
        /// The file.
        path: PathBuf,
    },
    /// An option left out all points.
    #[error("{option} leaves none of the {given} points; check that it is in the units of the file")]
    NothingLeft {
        /// Name of the option.
        option: &'static str,
        /// Number of points before.
        given: usize,
    },
    /// A row that is not among the points that are laid out.
    #[error(
        "{option} names row {row}, counted from 0, which is not among the points that are laid out: the file has fewer, or it was left out"
    )]
    NoSuchPoint {
        /// Name of the option.
        option: &'static str,
        /// The row.
        row: u64,
    },
    /// A corner is not on the boundary.
    #[error("--corners names row {row}, which is not on the outer boundary; take points of the outline")]
    CornerInside {
        /// The row.
        row: u32,
    },
    /// A point stands twice in the boundary.
    #[error("the boundary names point {row} twice; once round is enough")]
    BoundaryTwice {
        /// The row.
        row: u32,
    },
    /// Too few points on the boundary.
    #[error("the boundary that was given has {given} points; at least {required} are needed")]
    BoundaryTooShort {
        /// Number of points.
        given: usize,
        /// Number needed.
        required: usize,
    },
    /// A boundary file holds something else than rows.
    #[error("{}, line {line}: {text:?} is no row of a point; the file holds whole numbers from 0, separated by blanks, commas or line ends", path.display())]
    BoundaryFile {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What stands there.
        text: String,
    },
    /// Most points lie off the largest piece.
    #[error(
        "--clean stray would leave {kept} of {given} points: most lie off the largest piece, so they are not stray; the cloud may be rows \
         far apart (give the grid order, columns i,j), or several parts (fit them one by one)"
    )]
    NotStray {
        /// Points of the largest piece.
        kept: usize,
        /// Number of points.
        given: usize,
    },
    /// More control points than asked for before anything is refined.
    #[error(
        "--max-dofs {most} is less than the {dofs} control points that the fit starts with; allow as many, or start with a coarser --mesh"
    )]
    MaxDofs {
        /// Most control points.
        most: usize,
        /// Control points of the first mesh.
        dofs: usize,
    },
    /// A mask is no ESRI grid.
    #[error("{}: a mask is a grid file (.asc); cells that are 0 or without data are left out", path.display())]
    Mask {
        /// The file.
        path: PathBuf,
    },
    /// An option that fixed parameters need was given with another method.
    #[error("{option} is for --method ls and auto; {method} cannot follow it")]
    OtherMethod {
        /// Name of the option.
        option: &'static str,
        /// The method asked for.
        method: String,
    },
    /// A marker file holds something else than rows and types.
    #[error("{}, line {line}: {text:?} is no marker; a line holds the row of a point, from 0, and its type, I (must be met) or II (must be ignored)", path.display())]
    MarkerFile {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What stands there.
        text: String,
    },
    /// An option is out of its range.
    #[error("{option} = {given} is out of range: {allowed}")]
    OptionRange {
        /// Name of the option.
        option: &'static str,
        /// The value given.
        given: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The name of an output file tells no format.
    #[error("{}: the extension names no output format; possible are .step .stp .xml .json .obj .ply .vtk, or a directory", path.display())]
    OutputFormat {
        /// The output.
        path: PathBuf,
    },
    /// The name of an output of parameters tells no format.
    #[error("{}: parameters are written as .csv, or as a picture .svg", path.display())]
    ParameterFormat {
        /// The output.
        path: PathBuf,
    },
    /// A page was asked for of what has none.
    #[error("{}: only fits of surfaces have a page; the report of curves and of parameters is JSON", path.display())]
    NoPage {
        /// The report.
        path: PathBuf,
    },
    /// Several inputs need a directory to go to.
    #[error("{count} inputs cannot go to the single file {}; name a directory", path.display())]
    NeedsDirectory {
        /// The output.
        path: PathBuf,
        /// Number of inputs.
        count: usize,
    },
    /// Two inputs of a batch would write the same files.
    #[error("{} and {} would both be written as {name:?} in the output directory", first.display(), second.display())]
    SameName {
        /// One input.
        first: PathBuf,
        /// The other.
        second: PathBuf,
        /// The name.
        name: String,
    },
    /// A record of a batch cannot be understood.
    #[error("{}: no record of a part: {source}", path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// A directory without records of parts.
    #[error("{} holds no records of parts, which `thb fit` writes to {}", directory.display(), directory.join(crate::RECORDS).display())]
    NoRecords {
        /// The directory.
        directory: PathBuf,
    },
    /// A directory without scans.
    #[error("{} holds no file with the extension of a scan", path.display())]
    NoScans {
        /// The directory.
        path: PathBuf,
    },
    /// Arrays in memory have different numbers of rows.
    #[error("there are {given} {what} for {points} points; give one row for each point")]
    RowsDiffer {
        /// What was given.
        what: &'static str,
        /// Its number of rows.
        given: usize,
        /// The number of points.
        points: usize,
    },
    /// A confidence is negative or not finite.
    #[error("point {point} has the weight {value}; weights are 0 or more")]
    Weight {
        /// Row of the point.
        point: usize,
        /// Its weight.
        value: f64,
    },
    /// Two outputs would be written to the same file.
    #[error("two outputs go to {}, and one would replace the other; name different files", path.display())]
    OutputTwice {
        /// The file.
        path: PathBuf,
    },
    /// An output would replace an input.
    #[error("the output {} is an input and would be overwritten; name another file", path.display())]
    OutputIsInput {
        /// The file.
        path: PathBuf,
    },
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What it said.
        source: std::io::Error,
    },
    /// An operation is for surfaces, but the model is a curve.
    #[error("{}: the model is a curve; this needs a surface", path.display())]
    NotASurface {
        /// The model's file.
        path: PathBuf,
    },
    /// Points of a curve have one to three coordinates.
    #[error(
        "points have {given} coordinates; a curve needs 1 to 3, and a graph x and 1 to 3 values; choose them with --columns"
    )]
    CurveDimension {
        /// Number of coordinates.
        given: usize,
    },
    /// A graph needs x and a value.
    #[error("points have {given} coordinates; --graph needs x and a value")]
    GraphColumns {
        /// Number of coordinates.
        given: usize,
    },
    /// More knots than the points can determine.
    #[error(
        "{given} inner knots make {control_points} control points, more than the {points} points; ask for fewer --knots"
    )]
    TooManyKnots {
        /// Number of inner knots.
        given: usize,
        /// Number of control points they make.
        control_points: usize,
        /// Number of points.
        points: usize,
    },
    /// Corners on a closed curve whose parameters are given.
    #[error(
        "a closed curve with given parameters has no corners; use --corners none, or leave the parameters to --param chord"
    )]
    ClosedWithCorners,
    /// The name of an output of a curve tells no format.
    #[error("{}: the extension names no format of curves; possible are .step .stp .xml .json .svg .dxf", path.display())]
    CurveFormat {
        /// The output.
        path: PathBuf,
    },
}

/// What kind of thing went wrong: who can put it right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The caller: options that are not possible, or that do not go with each other or with the names of outputs.
    Usage,
    /// Whoever made the data: a file that cannot be read or written, points that cannot be laid out or fitted as asked.
    Input,
    /// Nobody but us: equations that could not be solved.
    Numeric,
}

impl Error {
    /// What kind of thing went wrong.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::OptionRange { .. }
            | Self::OtherMethod { .. }
            | Self::OutputFormat { .. }
            | Self::NoPage { .. }
            | Self::ParameterFormat { .. }
            | Self::CurveFormat { .. }
            | Self::SolidFormat { .. }
            | Self::NeedsDirectory { .. }
            | Self::SameName { .. }
            | Self::OutputTwice { .. }
            | Self::OutputIsInput { .. } => ErrorKind::Usage,
            Self::Fit(fit_ls::Error::RankDeficient { .. } | fit_ls::Error::OutOfMemory { .. })
            | Self::Moving(moving_param::Error::Minimization { .. })
            | Self::Parameterization(param_classic::ParamError::Solve { .. }) => ErrorKind::Numeric,
            _ => ErrorKind::Input,
        }
    }

    /// The same about points that are numbered otherwise outside: `outer` holds the number of each.
    pub(crate) fn of_rows(self, outer: &[u32]) -> Self {
        let number = |i: u32| outer[i as usize];
        match self {
            Self::CornerInside { row } => Self::CornerInside { row: number(row) },
            Self::BoundaryTwice { row } => Self::BoundaryTwice { row: number(row) },
            Self::Cloud(error) => Self::Cloud(error.renumbered(number)),
            Self::Parameterization(error) => Self::Parameterization(error.renumbered(number)),
            other => other,
        }
    }
}

// Both say everything themselves, with their hints: as sources they would say it again.
impl From<ReadError> for Error {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}

impl From<CloudError> for Error {
    fn from(error: CloudError) -> Self {
        Self::Cloud(error)
    }
}
