//! What helps against errors of the libraries, by the options as they are typed. The libraries themselves speak of the fields of
//! their options: they do not know who calls them.

use geom_io::ReadErrorKind;
use point_cloud::CloudError;

/// What follows the message of a scan that could not be read; empty where no option helps.
pub(crate) fn of_reading(kind: &ReadErrorKind) -> String {
    let hint = match kind {
        ReadErrorKind::UnknownExtension { .. } | ReadErrorKind::FormatNeeded => " (--format)",
        ReadErrorKind::Expansion { .. } => " (--max-expand)",
        ReadErrorKind::OptionOfOtherFormat { option, .. } => return format!("; leave out --{option}"),
        ReadErrorKind::ColumnNumber { .. } => " (--columns)",
        ReadErrorKind::NoNames { option } => return format!("; --{option} 4 takes the fourth column"),
        ReadErrorKind::OptionColumns { option, .. } => return format!("; give --{option} as many"),
        ReadErrorKind::AmbiguousComma { .. } | ReadErrorKind::GroupedNumber { .. } => {
            " (--decimal comma or --decimal point)"
        }
        ReadErrorKind::NoValues { .. } => "; --columns says which columns hold them",
        ReadErrorKind::NotANumberInTable { .. } => {
            "; --columns says which columns hold the coordinates, --skip how many lines stand before the points, --decimal the decimal sign"
        }
        ReadErrorKind::NoNumbers { .. } => "; --skip says how many lines stand before the points",
        ReadErrorKind::ColumnsNotFound { .. } => {
            "; --columns says which ones hold the coordinates, by names or numbers"
        }
        ReadErrorKind::DuplicateColumn { .. } => " (--columns)",
        ReadErrorKind::GridIndex { .. } => "; --grid names them, or none",
        _ => return String::new(),
    };
    hint.to_owned()
}

/// What follows the message of a cloud that cannot be fitted; empty where no option helps.
pub(crate) fn of_cloud(error: &CloudError) -> &'static str {
    match error {
        CloudError::CloudPieces { .. } => "; --piece 1 takes the largest piece, --piece all each for itself",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use geom_io::{ReadOptions, read_scan};

    use crate::Error;

    /// Messages of the library name no option as it is typed, and those of this crate do, once.
    #[test]
    fn options_are_typed_where_they_help() {
        let normals = ReadOptions { normals: Some(vec!["1".into(), "2".into()]), ..ReadOptions::default() };
        let weights = ReadOptions { weights: Some("w".into()), ..ReadOptions::default() };
        let grid = ReadOptions { grid: Some(vec!["1".into(), "2".into()]), ..ReadOptions::default() };
        let plain = ReadOptions::default();
        for (name, text, options, hint) in [
            ("a.tab", "1 2 3\n", &plain, "--format"),
            ("a.xyz", "0,5,1,5,2,0\n0,5,1,05,2,1\n", &plain, "--decimal comma or"),
            ("a.xyz", "1,000.5 2 3\n", &plain, "--decimal comma or"),
            ("a.csv", "t,a\n1,2\n", &plain, "--columns"),
            ("a.csv", "x,x,y\n1,2,3\n", &plain, "--columns"),
            ("a.csv", "x,y,z\n1,2,nan\n", &plain, "--columns"),
            ("a.csv", "x,y,z\n1,2,3\n1,2,a\n", &plain, "--skip"),
            ("a.xyz", "X1 Y2\nX1 Y2\n", &plain, "--skip"),
            ("a.xyz", "1 2 3\n", &normals, "--normals"),
            ("a.xyz", "1 2 3\n", &weights, "--weights"),
            ("a.xyz", "0.5 2 3\n", &grid, "--grid"),
            ("a.off", "OFF\n1 0 0\n0 0 0\n", &normals, "--normals"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(name);
            std::fs::File::create(&path).unwrap().write_all(text.as_bytes()).unwrap();
            let error = read_scan(&path, options).unwrap_err();
            assert!(!error.to_string().contains("--"), "{error}");
            let told = Error::from(error).to_string();
            assert!(told.matches(hint).count() == 1 && told.contains(name), "{told}");
        }
    }
}
