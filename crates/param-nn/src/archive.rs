//! Named tensors with metadata, as safetensors: a length, a JSON header, numbers.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use crate::error::NnError;

/// Where safetensors keep text about the file.
const METADATA: &str = "__metadata__";

/// Name of the metadata that holds the checksum of the numbers.
const CHECKSUM: &str = "checksum";

/// Tensors of `f32` with two indices, and text.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Archive {
    pub(crate) metadata: BTreeMap<String, String>,
    pub(crate) tensors: BTreeMap<String, ([usize; 2], Vec<f32>)>,
}

impl Archive {
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut numbers = Vec::new();
        let mut header = Map::new();
        for (name, (shape, values)) in &self.tensors {
            let start = numbers.len();
            values.iter().for_each(|x| numbers.extend_from_slice(&x.to_le_bytes()));
            let entry = json!({ "dtype": "F32", "shape": shape, "data_offsets": [start, numbers.len()] });
            header.insert(name.clone(), entry);
        }
        let mut metadata = self.metadata.clone();
        metadata.insert(CHECKSUM.into(), checksum(&numbers));
        header.insert(METADATA.into(), json!(metadata));
        let mut header = Value::Object(header).to_string().into_bytes();
        // The numbers start at a multiple of eight, as readers that map files expect.
        header.resize(header.len().next_multiple_of(8), b' ');
        let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
        bytes.extend(header);
        bytes.extend(numbers);
        bytes
    }

    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, NnError> {
        let damaged = |reason: String| NnError::DamagedWeights { bytes: bytes.len(), reason };
        let (length, rest) = bytes.split_first_chunk::<8>().ok_or_else(|| damaged("it has no header".into()))?;
        let length = u64::from_le_bytes(*length);
        let split = usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length));
        let (header, numbers) = split.ok_or_else(|| damaged(format!("its header is said to have {length} bytes")))?;
        let header: Map<String, Value> =
            serde_json::from_slice(header).map_err(|e| damaged(format!("its header is no JSON object: {e}")))?;
        let mut archive = Self::default();
        for (name, entry) in header {
            if name == METADATA {
                archive.metadata = serde_json::from_value(entry).map_err(|e| damaged(format!("its metadata: {e}")))?;
                continue;
            }
            let tensor = read_tensor(&entry, numbers).ok_or_else(|| damaged(format!("tensor {name} is {entry}")))?;
            archive.tensors.insert(name, tensor);
        }
        let found = checksum(numbers);
        match archive.metadata.remove(CHECKSUM) {
            Some(stated) if stated == found => Ok(archive),
            stated => Err(damaged(format!("the checksum of its numbers is {found}, it says {stated:?}"))),
        }
    }
}

fn read_tensor(entry: &Value, numbers: &[u8]) -> Option<([usize; 2], Vec<f32>)> {
    let index = |name: &str, k: usize| entry.get(name)?.get(k)?.as_u64().and_then(|x| usize::try_from(x).ok());
    let shape = [index("shape", 0)?, index("shape", 1)?];
    let part = numbers.get(index("data_offsets", 0)?..index("data_offsets", 1)?)?;
    let is_single = entry.get("dtype")?.as_str()? == "F32" && entry.get("shape")?.as_array()?.len() == 2;
    let expected = shape[0].checked_mul(shape[1])?.checked_mul(4)?;
    let values = part.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    (is_single && part.len() == expected).then_some((shape, values))
}

/// FNV-1a of 64 bits: finds damage, not malice.
pub(crate) fn checksum(bytes: &[u8]) -> String {
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3));
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn archive() -> Archive {
        let mut archive = Archive::default();
        archive.metadata.insert("command".into(), "cargo xtask train \"x\"".into());
        archive.tensors.insert("b".into(), ([1, 3], vec![1.0, -2.5, f32::MIN_POSITIVE]));
        archive.tensors.insert("a".into(), ([2, 2], vec![0.0, 1e9, -0.0, 3.0]));
        archive
    }

    #[test]
    fn archives_come_back() {
        let bytes = archive().to_bytes();
        assert_eq!(Archive::from_bytes(&bytes).unwrap(), archive());
        assert_eq!(bytes, archive().to_bytes());
    }

    #[test]
    fn the_checksum_is_fnv() {
        // Test vectors of the algorithm's authors.
        assert_eq!((checksum(b"").as_str(), checksum(b"foobar").as_str()), ("cbf29ce484222325", "85944171f73967e8"));
    }

    #[test]
    fn every_changed_or_missing_byte_is_found() {
        let bytes = archive().to_bytes();
        for length in 0..bytes.len() {
            assert!(Archive::from_bytes(&bytes[..length]).is_err(), "{length} bytes were read");
        }
        let numbers = bytes.len() - 7 * 4;
        for place in numbers..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 1;
            assert!(matches!(Archive::from_bytes(&changed), Err(NnError::DamagedWeights { .. })), "byte {place}");
        }
        for place in 0..numbers {
            let mut changed = bytes.clone();
            changed[place] ^= 0x80;
            // No panic; most are errors, all are errors or another name or text.
            let _ = Archive::from_bytes(&changed).map(|read| assert_ne!(read, archive()));
        }
    }
}
