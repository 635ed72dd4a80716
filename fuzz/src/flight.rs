//! Flights: read, written again, flown.

use crate::fly::flies;
use crate::land::TERRAINS;
use crate::seeds::{self, Inputs};
use crate::words::told;
use std::path::Path;
use std::sync::Arc;
use terrasoar::flight::{Flight, FlightReader};

pub(crate) fn seeds() -> Inputs {
    seeds::flights()
}

pub(crate) fn body(data: &[u8]) {
    let path = Path::new("f.flight");
    let Some(flight) = told(read(data, path)) else { return };
    assert!(!flight.frames.is_empty());
    let text = flight
        .write_to(Vec::new(), path)
        .unwrap_or_else(|error| panic!("read and cannot be written: {error}"));
    let again = read(&text, path).unwrap_or_else(|error| panic!("written and cannot be read: {error}"));
    assert_eq!(again, flight, "what is written reads back as another flight");
    // Over a terrain with voids, and over one that was edited.
    for land in TERRAINS.iter().filter(|land| ["compact", "edited, exact"].contains(&land.name)) {
        let terrain =
            land.files.open().unwrap_or_else(|error| panic!("a sound terrain does not open: {error}"));
        flies(&Arc::new(terrain), &flight.frames, true);
    }
}

fn read(data: &[u8], path: &Path) -> Result<Flight, terrasoar::flight::FlightError> {
    let mut reader = FlightReader::new(data, path)?;
    let frames = reader.by_ref().collect::<Result<_, _>>()?;
    Ok(Flight { notes: reader.notes().to_vec(), frames })
}
