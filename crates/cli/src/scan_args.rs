//! What is typed for scans: how they are read, cleaned and laid out.

use std::path::PathBuf;

use clap::Args;
use reconstruct::{
    Clean, Closed, Crop, Decimal, Domain, Format, GivenCorners, LengthUnit, Networks, ParameterChoice,
    ParameterOptions, RadiusChoice, ReadOptions, Refine, SideRule,
};

/// How scans are cleaned and laid out.
#[derive(Args, Debug)]
pub(crate) struct LayoutArgs {
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    /// Remove points: outliers (neighbours unusually far away), stray (all pieces but the largest), none.
    ///
    /// Without, values far beyond the rest,
    /// points that stand alone and copies are set aside, with a warning; none keeps them too.
    #[arg(long, value_delimiter = ',', value_name = "WHAT", help_heading = "How it is cleaned")]
    clean: Vec<Clean>,
    /// Keep one piece of a mesh or cloud that has several: 1 for the largest, 2 for the next, and so on. With all thb fit fits each for
    /// itself and writes them to one file (.json and .xml: a file each).
    #[arg(long, value_name = "K", value_parser = piece, help_heading = "How it is cleaned")]
    piece: Option<Piece>,
    /// Keep at most as many points, well spread.
    #[arg(long, value_name = "N", help_heading = "How it is cleaned")]
    thin: Option<usize>,
    /// Keep the points within a rectangle of x and y. The parameters of a height field are spread over what is left.
    #[arg(long, value_name = "X0,X1,Y0,Y1", allow_hyphen_values = true, help_heading = "How it is cleaned")]
    crop: Option<Crop>,
    /// Keep the points over cells of a grid file (.asc) that are neither 0 nor without data.
    #[arg(long, value_name = "GRID", help_heading = "How it is cleaned")]
    mask: Option<PathBuf>,

    /// Parameters: auto, given, chord, centripetal, parcnn, uniform, mean-value, recd, lpsp, pargcn, bidgcn. auto takes those of the file, else maps
    /// the mesh with mean-value weights, else goes by chord length along the grid, else spans a mesh over the cloud. uniform,
    /// recd and lpsp lay out a cloud by its boundary and weights of neighbours. parcnn (grids), pargcn and bidgcn (clouds) are networks.
    #[arg(long, default_value_t = ParameterOptions::default().param, help_heading = "How it is laid out")]
    param: ParameterChoice,
    /// Parameter domain: unit (parameters of the file must lie between 0 and 1) or data (the box of the parameters; a fixed
    /// --lambda then applies in their units).
    #[arg(long, default_value_t = ParameterOptions::default().domain, help_heading = "How it is laid out")]
    domain: Domain,
    /// Directions in which the surface closes on itself: auto, none, u, v or uv. auto is u for meshes and clouds that are tubes by their
    /// shape, else none; the others are for grids whose lines close, for meshes and clouds of tubes, and for parameters of the file, which then wrap at 1. --mesh must have more elements there than the degree.
    #[arg(long, default_value_t = ParameterOptions::default().closed, help_heading = "How it is laid out")]
    closed: Closed,
    /// Four points of the outline that become the corners (0,0), (1,0), (1,1), (0,1): their rows in the file, from 0.
    /// [default: chosen by the turning of the outline]
    #[arg(long, value_name = "A,B,C,D", help_heading = "How it is laid out")]
    corners: Option<GivenCorners>,
    /// A text file that names the points of the outer boundary by their rows, from 0. A column `boundary` of a CSV file,
    /// 0 for inside, does the same. [default: found]
    #[arg(long, value_name = "FILE", help_heading = "How it is laid out")]
    outline: Option<PathBuf>,
    /// How the points of a side are spread over it: chord, centripetal or uniform.
    #[arg(long, default_value_t = ParameterOptions::default().side_rule, help_heading = "How it is laid out")]
    side_rule: SideRule,
    /// Radius of the neighbourhoods of uniform, recd and lpsp: grow (until every point has a path to the boundary), auto
    /// (3/√m of the extent) or a length.
    #[arg(long, default_value_t = ParameterOptions::default().radius, help_heading = "How it is laid out")]
    radius: RadiusChoice,
    /// Refine maps of meshes towards less distortion: auto (where they are stretched in places, but not on the whole), on or off.
    #[arg(long, default_value_t = ParameterOptions::default().refine, help_heading = "How it is laid out")]
    refine: Refine,
    /// Ask networks beside the map of a cloud that is laid out by its shape, and take their parameters where they are better:
    /// on or off.
    #[arg(long, default_value_t = ParameterOptions::default().networks, help_heading = "How it is laid out")]
    networks: Networks,
    /// Points laid out at once: a cloud of more than three times as many goes through a well-spread subset of this size.
    #[arg(long, default_value_t = ParameterOptions::default().subset, value_name = "N", help_heading = "How it is laid out")]
    subset: usize,
}

impl LayoutArgs {
    /// Whether every piece is meant.
    pub(crate) fn all_pieces(&self) -> bool {
        self.piece == Some(Piece::All)
    }

    /// The options of laying out.
    pub(crate) fn options(&self) -> ParameterOptions {
        ParameterOptions {
            read: self.read.options(),
            clean: self.clean.clone(),
            piece: self.piece.and_then(Piece::number),
            thin: self.thin,
            crop: self.crop,
            mask: self.mask.clone(),
            param: self.param,
            domain: self.domain,
            closed: self.closed,
            corners: self.corners,
            outline: self.outline.clone(),
            side_rule: self.side_rule,
            radius: self.radius,
            refine: self.refine,
            networks: self.networks,
            subset: self.subset,
            told: None,
        }
    }
}

/// How scans are read where a file leaves it open.
#[derive(Args, Debug)]
#[command(next_help_heading = "How it is read")]
pub(crate) struct ReadArgs {
    /// Format by one of its extensions, such as xyz or ply, whatever the file's name is; needed for standard input.
    /// [default: by the file's extension; .gz behind it is decompressed, and a .zip with one scan inside is opened]
    #[arg(long, value_name = "EXT", value_parser = format)]
    format: Option<Format>,
    /// Columns of text files that hold x, y, z: names, or numbers from 1, as in x_km,y_km,z or 2,3,4. No others are then guessed to be
    /// grid indices or normals.
    #[arg(long, value_delimiter = ',')]
    columns: Vec<String>,
    /// Columns of text files that hold the normal of the surface: names or numbers, as in 4,5,6; or none. [default: nx, ny, nz and
    /// the like, and i, j, k where they aren't grid indices]
    #[arg(long, value_delimiter = ',', value_name = "NX,NY,NZ|none")]
    normals: Option<Vec<String>>,
    /// Columns of text files that hold the row and the column of each point in a grid: names or numbers; or none.
    /// [default: i and j, or row and column, where they are whole numbers]
    #[arg(long, value_delimiter = ',', value_name = "I,J|none")]
    grid: Option<Vec<String>>,
    /// Lines at the start of a text file that are not looked at.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    skip: usize,
    /// Decimal sign of text files: point or comma; the other one may part thousands. [default: by the numbers]
    #[arg(long, value_name = "SIGN", value_parser = decimal)]
    decimal: Option<Decimal>,
    /// Classes of a LAS or LAZ file whose points are read, as in 2,9. [default: all]
    #[arg(long = "class", value_delimiter = ',', value_name = "CLASSES")]
    classes: Vec<u8>,
    /// Take x and y, each scaled to 0 to 1, as parameters of points that have none: z is a height over them.
    #[arg(long)]
    height_field: bool,
    /// How many times their own size compressed data (.gz, .zip, .laz, .3mf) may expand to. [default: 200, and 12 MiB at most for the first MiB]
    #[arg(long, value_name = "TIMES")]
    max_expand: Option<usize>,
}

impl ReadArgs {
    /// The options of reading.
    pub(crate) fn options(&self) -> ReadOptions {
        ReadOptions {
            format: self.format,
            columns: trimmed(&self.columns),
            normals: self.normals.as_deref().map(named),
            grid: self.grid.as_deref().map(named),
            skip: self.skip,
            decimal: self.decimal,
            classes: self.classes.clone(),
            weights: None,
            height_field: self.height_field,
            max_expand: self.max_expand,
        }
    }
}

fn trimmed(columns: &[String]) -> Vec<String> {
    columns.iter().map(|column| column.trim().to_owned()).collect()
}

/// Columns by name; the one word `none` stands for no columns.
fn named(columns: &[String]) -> Vec<String> {
    if columns.len() == 1 && columns[0].trim() == "none" { Vec::new() } else { trimmed(columns) }
}

fn decimal(text: &str) -> Result<Decimal, String> {
    match text {
        "point" => Ok(Decimal::Point),
        "comma" => Ok(Decimal::Comma),
        _ => Err("point or comma".to_owned()),
    }
}

fn format(text: &str) -> Result<Format, String> {
    let all = || Format::ALL.iter().flat_map(|format| format.extensions()).copied().collect::<Vec<_>>().join(", ");
    // As reports have it.
    let by_name = Format::ALL.into_iter().find(|format| format.name() == text);
    let by_extension = || Format::from_extension(text.trim_start_matches('.'));
    by_name.map_or_else(by_extension, Ok).map_err(|_| format!("possible are {}", all()))
}

/// The pieces that are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Piece {
    /// Each for itself.
    All,
    /// One, from 1.
    Number(usize),
}

impl Piece {
    fn number(self) -> Option<usize> {
        match self {
            Self::All => None,
            Self::Number(number) => Some(number),
        }
    }
}

fn piece(text: &str) -> Result<Piece, String> {
    let expected = "1 for the largest piece, 2 for the next, and so on, or all";
    match text {
        "all" => Ok(Piece::All),
        _ => text.parse().map(Piece::Number).map_err(|_| expected.to_owned()),
    }
}

pub(crate) fn unit(text: &str) -> Result<LengthUnit, String> {
    match text {
        "um" | "µm" | "μm" => Ok(LengthUnit::Micrometre),
        "mm" => Ok(LengthUnit::Millimetre),
        "cm" => Ok(LengthUnit::Centimetre),
        "m" => Ok(LengthUnit::Metre),
        "inch" | "in" => Ok(LengthUnit::Inch),
        "ft" | "foot" => Ok(LengthUnit::Foot),
        // As reports have it.
        _ => LengthUnit::from_name(text).ok_or_else(|| "um, mm, cm, m, inch or ft".to_owned()),
    }
}
