use crate::document::Document;
use crate::source::Source;
use crate::{Error, Format, Limits};
pub(crate) fn read(_file: Source, _limits: Limits) -> Result<Document, Error> {
    Err(Format::Hdf5.unsupported("an HDF5 file", "not read"))
}
