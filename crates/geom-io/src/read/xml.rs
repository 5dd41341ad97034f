//! XML of which the tree may be built.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// Limit: attributes of an element. They are compared with one another, so that time grows with their square.
const MAX_ATTRIBUTES: usize = 128;

/// Limit: declarations of namespaces in a document. Each element that makes one copies those round it. Formats that we read
/// declare fewer than ten, all at the root.
const MAX_NAMESPACES: usize = 64;

/// Checks that a tree of a text can be built in time and memory that grow with its length only.
///
/// # Errors
/// What is too much, or not well-formed, and at which line and column.
pub(crate) fn check(text: &str) -> Result<(), String> {
    let mut reader = Reader::from_str(text);
    // The names of elements are compared where the tree is built.
    reader.config_mut().check_end_names = false;
    let mut namespaces = 0;
    loop {
        let event =
            reader.read_event().map_err(|error| format!("{error} at {}", place(text, reader.error_position())))?;
        match event {
            Event::Start(element) | Event::Empty(element) => {
                let declared = count(&element);
                namespaces +=
                    declared.map_err(|reason| format!("{reason} at {}", place(text, reader.buffer_position())))?;
                if namespaces > MAX_NAMESPACES {
                    return Err(format!("more than {MAX_NAMESPACES} declarations of namespaces"));
                }
            }
            Event::Eof => return Ok(()),
            _ => {}
        }
    }
}

/// Line and column of a byte, both from 1.
fn place(text: &str, byte: u64) -> String {
    let before = text.as_bytes().get(..byte as usize).unwrap_or(text.as_bytes());
    let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
    let column = 1 + before.iter().rev().take_while(|&&b| b != b'\n').count();
    format!("{line}:{column}")
}

/// How many namespaces an element declares, if its attributes are not too many.
fn count(element: &BytesStart<'_>) -> Result<usize, String> {
    let mut namespaces = 0;
    for (index, attribute) in element.attributes().with_checks(false).enumerate() {
        let attribute = attribute.map_err(|error| error.to_string())?;
        namespaces += usize::from(attribute.key.as_namespace_binding().is_some());
        if index >= MAX_ATTRIBUTES {
            return Err(format!("an element with more than {MAX_ATTRIBUTES} attributes"));
        }
    }
    Ok(namespaces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_time_is_counted() {
        let nested = |depth: usize| {
            let open: String = (0..depth).map(|k| format!("<a xmlns:n{k}=\"u{k}\">")).collect();
            format!("{open}{}", "</a>".repeat(depth))
        };
        let attributes = |number: usize| {
            let list: String = (0..number).map(|k| format!(" a{k}=\"\"")).collect();
            format!("<a{list}/>")
        };
        assert_eq!(check(&nested(MAX_NAMESPACES)), Ok(()));
        assert!(check(&nested(MAX_NAMESPACES + 1)).unwrap_err().contains("namespaces"));
        assert_eq!(check(&attributes(MAX_ATTRIBUTES)), Ok(()));
        assert!(check(&attributes(MAX_ATTRIBUTES + 1)).unwrap_err().contains("attributes"));
        assert!(check("<a>\n<b c></a>").unwrap_err().contains(" at 2:"));
        assert_eq!(check("<?xml version=\"1.0\"?><!-- - --><a b=\"1\"><![CDATA[<]]>text &amp; more</a>\n"), Ok(()));
    }
}
