//! What the motions of a chunk of a sweep's dataset are.

use super::dataset::CLASSES;
use crate::dataset::{Store, StoreError, Values};
use crate::study::simulate::Classification;

/// The classification that a code means.
pub(crate) fn class_of(code: u8) -> Option<Classification> {
    usize::from(code)
        .checked_sub(1)
        .and_then(|k| CLASSES.get(k))
        .copied()
}

/// What the motions of a chunk are.
pub(crate) struct Motions {
    pub(crate) codes: Vec<u8>,
    pub(crate) periods: Vec<i32>,
}

impl Motions {
    pub(crate) fn read(store: &Store, chunk: usize) -> Result<Self, StoreError> {
        let block = store.schema().grid.block(chunk);
        let of = |name| match store.schema().index_of(name) {
            Some(variable) => store.read_chunk(&block, variable),
            None => Err(StoreError::NotAStore {
                path: store.path().into(),
                what: format!("it is no sweep: it has no variable `{name}`"),
            }),
        };
        match (of("classification")?, of("period")?) {
            (Values::Code(codes), Values::Whole(periods)) => Ok(Self { codes, periods }),
            _ => Err(StoreError::NotAStore {
                path: store.path().into(),
                what: "it is no sweep: its variables have other types".into(),
            }),
        }
    }
}
