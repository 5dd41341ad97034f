//! Names of columns: what each says that its column holds.

use super::super::text::{parse_count, quote};
use super::fields::{Field, Separator};
use crate::error::ReadErrorKind;

/// Names of the same thing, in the order in which they are looked for; as [`plain`] leaves them.
type Synonyms = &'static [&'static str];

const X: Synonyms = &[
    "x",
    "easting",
    "east",
    "rechtswert",
    "points:0",
    "points0",
    "pointsx",
    "pointx",
    "xcoord",
    "xcoordinate",
    "xposition",
    "positionx",
    "posx",
    "coordx",
];
const Y: Synonyms = &[
    "y",
    "northing",
    "north",
    "hochwert",
    "points:1",
    "points1",
    "pointsy",
    "pointy",
    "ycoord",
    "ycoordinate",
    "yposition",
    "positiony",
    "posy",
    "coordy",
];
const Z: Synonyms = &[
    "z",
    "elevation",
    "elev",
    "height",
    "altitude",
    "alt",
    "höhe",
    "hoehe",
    "points:2",
    "points2",
    "pointsz",
    "pointz",
    "zcoord",
    "zcoordinate",
    "zposition",
    "positionz",
    "posz",
    "coordz",
];
/// Easting, northing and height by their letters, which mean that only together.
const LETTERS: [Synonyms; 3] = [&["e"], &["n"], &["h"]];

/// Normals by names that mean nothing else. (i, j, k may.)
const NORMALS: [Synonyms; 3] = [
    &["nx", "normalx", "xnormal", "xn", "normals:0", "normals0"],
    &["ny", "normaly", "ynormal", "yn", "normals:1", "normals1"],
    &["nz", "normalz", "znormal", "zn", "normals:2", "normals2"],
];

/// Grid indices by names that mean nothing else.
const ROW_AND_COLUMN: [Synonyms; 2] = [&["row"], &["col", "column"]];

/// Words that name columns which are not read, and so tell a line of names from a title.
const OTHERS: Synonyms = &[
    "id",
    "no",
    "nr",
    "point",
    "pointid",
    "pt",
    "name",
    "label",
    "code",
    "index",
    "intensity",
    "reflectance",
    "r",
    "g",
    "b",
    "red",
    "green",
    "blue",
    "time",
    "timestamp",
    "u",
    "v",
    "i",
    "j",
    "k",
    "nx",
    "ny",
    "nz",
    "boundary",
    "row",
];

/// The names of a table, as in the file but for quotes, and in plain form for comparison.
#[derive(Clone, Debug)]
pub(super) struct Names {
    pub(super) written: Vec<String>,
    plain: Vec<String>,
}

/// Coordinates that names tell, and by which of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Coordinates {
    pub(super) columns: Vec<usize>,
}

/// Columns i, j and perhaps k, of which the values tell what they hold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ijk {
    pub(super) ij: [usize; 2],
    pub(super) k: Option<usize>,
}

/// Most names in a message.
const MOST_LISTED: usize = 20;

impl Names {
    /// The fields of a line as names.
    pub(super) fn of(fields: &[Field<'_>]) -> Self {
        let written: Vec<String> = fields.iter().map(|field| text_of(field.text)).collect();
        let plain = written.iter().map(|name| plain(name)).collect();
        Self { written, plain }
    }

    /// The names of a line of `columns` names, one reading for each separator that makes as many; that of the rows comes first.
    /// `VARIABLES =` and the like before the names don't count, nor do units in brackets behind them.
    pub(super) fn in_line(line: &[u8], separator: Separator, columns: usize) -> Vec<Self> {
        let after = |sign: u8| line.iter().position(|&b| b == sign).map(|at| &line[at + 1..]);
        let parts = [Some(line), after(b'='), after(b':')];
        let others = [Separator::Byte(b','), Separator::Byte(b';'), Separator::Byte(b'\t'), Separator::Blanks];
        let (mut fields, mut readings) = (Vec::new(), Vec::new());
        for part in parts.into_iter().flatten() {
            for separator in std::iter::once(separator).chain(others) {
                separator.split(part, &mut fields);
                if !separator.is_explicit() {
                    join_units(part, &mut fields);
                }
                while fields.len() > columns && fields.last().is_some_and(|field| field.text.is_empty()) {
                    fields.pop();
                }
                if fields.len() == columns {
                    readings.push(Self::of(&fields));
                }
            }
        }
        readings
    }

    /// Names as messages list them: short ones, and not all where there are many.
    pub(super) fn listed(&self, columns: impl Iterator<Item = usize>) -> Vec<String> {
        let mut listed: Vec<String> = columns.map(|column| crate::error::quote(&self.written[column])).collect();
        let more = listed.len().saturating_sub(MOST_LISTED);
        if more > 0 {
            listed.truncate(MOST_LISTED);
            listed.push(format!("… ({more} more)"));
        }
        listed
    }

    /// The column of a name, upper and lower case being the same; units behind a name need not be given.
    ///
    /// # Errors
    /// [`ReadErrorKind::DuplicateColumn`].
    pub(super) fn find(&self, name: &str) -> Result<Option<usize>, ReadErrorKind> {
        let exact = |k: &usize| self.written[*k].eq_ignore_ascii_case(name.trim());
        match self.only(exact, name)? {
            Some(column) => Ok(Some(column)),
            None => self.only(|&k| !self.plain[k].is_empty() && self.plain[k] == plain(name), name),
        }
    }

    fn only(&self, fits: impl Fn(&usize) -> bool, name: &str) -> Result<Option<usize>, ReadErrorKind> {
        let mut places = (0..self.written.len()).filter(fits);
        match (places.next(), places.next()) {
            (Some(_), Some(_)) => Err(ReadErrorKind::DuplicateColumn { name: quote(name.as_bytes()) }),
            (place, _) => Ok(place),
        }
    }

    /// The column of a name, or of a number from 1 on.
    pub(super) fn find_or_number(&self, name: &str) -> Result<Option<usize>, ReadErrorKind> {
        let by_number = || parse_count(name.as_bytes()).filter(|n| (1..=self.written.len()).contains(n)).map(|n| n - 1);
        Ok(self.find(name)?.or_else(by_number))
    }

    fn first_of(&self, synonyms: Synonyms) -> Result<Option<usize>, ReadErrorKind> {
        for name in synonyms {
            if let Some(column) = self.find(name)? {
                return Ok(Some(column));
            }
        }
        Ok(None)
    }

    /// The coordinates x, y and, where it is there, z; or the names that are missing.
    pub(super) fn coordinates(&self) -> Result<Result<Coordinates, Vec<String>>, ReadErrorKind> {
        let [x, y, z] = [self.first_of(X)?, self.first_of(Y)?, self.first_of(Z)?];
        if let (Some(x), Some(y)) = (x, y) {
            return Ok(Ok(Coordinates { columns: [x, y].into_iter().chain(z).collect() }));
        }
        if x.is_none() && y.is_none() {
            let [e, n, h] = [self.first_of(LETTERS[0])?, self.first_of(LETTERS[1])?, self.first_of(LETTERS[2])?];
            if let (Some(e), Some(n)) = (e, n) {
                return Ok(Ok(Coordinates { columns: [e, n].into_iter().chain(z.or(h)).collect() }));
            }
        }
        Ok(Err([(x, "x"), (y, "y")].iter().filter(|(c, _)| c.is_none()).map(|(_, name)| (*name).to_owned()).collect()))
    }

    /// Columns of a normal by names that mean nothing else.
    pub(super) fn normals(&self) -> Result<Option<[usize; 3]>, ReadErrorKind> {
        let [x, y, z] = [self.first_of(NORMALS[0])?, self.first_of(NORMALS[1])?, self.first_of(NORMALS[2])?];
        Ok(x.zip(y).zip(z).map(|((x, y), z)| [x, y, z]))
    }

    /// The columns i and j, and k where it is there.
    pub(super) fn ijk(&self) -> Result<Option<Ijk>, ReadErrorKind> {
        let [i, j, k] = [self.first_of(&["i"])?, self.first_of(&["j"])?, self.first_of(&["k"])?];
        Ok(i.zip(j).map(|(i, j)| Ijk { ij: [i, j], k }))
    }

    /// The columns of grid indices that are named row and column.
    pub(super) fn row_and_column(&self) -> Result<Option<[usize; 2]>, ReadErrorKind> {
        let [row, column] = [self.first_of(ROW_AND_COLUMN[0])?, self.first_of(ROW_AND_COLUMN[1])?];
        Ok(row.zip(column).map(|(row, column)| [row, column]))
    }

    /// Whether some are known to name columns.
    pub(super) fn are_known(&self) -> bool {
        let known = [X, Y, Z, OTHERS];
        self.plain.iter().any(|name| known.iter().any(|synonyms| synonyms.contains(&name.as_str())))
    }
}

/// A text as it is written, in UTF-8 or else in Latin-1, without the control characters.
fn text_of(bytes: &[u8]) -> String {
    let text =
        std::str::from_utf8(bytes).map_or_else(|_| bytes.iter().copied().map(char::from).collect(), str::to_owned);
    text.chars().filter(|c| !c.is_control()).collect()
}

/// A name in lower case, without what is in brackets, and without blanks and lines between its words: `X [mm]`, `x(m)`
/// and `X_coord` become `x`, `x` and `xcoord`.
fn plain(name: &str) -> String {
    let before = name
        .trim()
        .trim_start_matches(['#', '/', '%'])
        .trim_matches('\'')
        .split(['[', '(', '{'])
        .next()
        .unwrap_or_default();
    let mut words: Vec<&str> = before.split([' ', '_', '-', '.', '\t']).filter(|word| !word.is_empty()).collect();
    // A unit without brackets.
    if words.len() == 2 && ["mm", "cm", "m", "inch", "in", "ft", "um", "µm"].contains(&words[1].to_lowercase().as_str())
    {
        words.pop();
    }
    words.concat().to_lowercase()
}

/// Joins units that stand behind names and a blank, `X [mm]`, to these.
fn join_units<'a>(line: &'a [u8], fields: &mut Vec<Field<'a>>) {
    let offset = |text: &[u8]| text.as_ptr() as usize - line.as_ptr() as usize;
    let mut joined: Vec<Field<'a>> = Vec::with_capacity(fields.len());
    for field in fields.drain(..) {
        match joined.last_mut() {
            Some(last) if matches!(field.text.first(), Some(b'[' | b'(')) && !last.quoted && !field.quoted => {
                last.text = &line[offset(last.text)..offset(field.text) + field.text.len()];
            }
            _ => joined.push(field),
        }
    }
    *fields = joined;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(line: &str, columns: usize) -> Names {
        let readings = Names::in_line(line.as_bytes(), Separator::Blanks, columns);
        let tells = readings.iter().find(|names| names.coordinates().is_ok_and(|found| found.is_ok()));
        tells.unwrap_or(&readings[0]).clone()
    }

    #[test]
    fn coordinates_by_many_names() {
        for (line, columns, expected) in [
            ("X [mm] Y [mm] Z [mm]", 3, &[0, 1, 2][..]),
            ("X[mm],Y[mm],Z[mm]", 3, &[0, 1, 2]),
            // Between blanks there are as many words, which are no names.
            ("Y, X, Z", 3, &[1, 0, 2]),
            ("Z; Y; X", 3, &[2, 1, 0]),
            ("'y' 'x'", 2, &[1, 0]),
            ("position.x,position.y,position.z", 3, &[0, 1, 2]),
            ("Nr;Rechtswert;Hochwert;Höhe", 4, &[1, 2, 3]),
            ("Y X Z", 3, &[1, 0, 2]),
            ("No.;Easting;Northing;Elevation", 4, &[1, 2, 3]),
            ("VARIABLES = \"X\" \"Y\" \"Z\"", 3, &[0, 1, 2]),
            ("Columns: id x_mm y_mm z_mm", 4, &[1, 2, 3]),
            ("\"Points:0\",\"Points:1\",\"Points:2\",T", 4, &[0, 1, 2]),
            ("pt,N,E,Z", 4, &[2, 1, 3]),
            ("X-Coordinate\tY-Coordinate", 2, &[0, 1]),
            ("z y x", 3, &[2, 1, 0]),
        ] {
            assert_eq!(names(line, columns).coordinates().unwrap().unwrap().columns, expected, "{line}");
        }
        assert_eq!(names("t a", 2).coordinates().unwrap().unwrap_err(), ["x", "y"]);
        assert_eq!(names("x z", 2).coordinates().unwrap().unwrap_err(), ["y"]);
        assert!(names("x y X", 3).coordinates().is_err());
        assert!(Names::in_line(b"a scan of a part", Separator::Blanks, 3).is_empty());
    }

    #[test]
    fn names_are_found_as_they_are_written_and_without_units() {
        let names = names("x_mm [a],Y (mm),y2", 3);
        assert_eq!(names.find("X_MM [A]").unwrap(), Some(0));
        assert_eq!(names.find("y").unwrap(), Some(1));
        assert_eq!(names.find_or_number("3").unwrap(), Some(2));
        assert_eq!(names.find_or_number("4").unwrap(), None);
        assert!(names.are_known());
    }
}
