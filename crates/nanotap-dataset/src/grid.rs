//! The grid of chunks that all computed variables of a dataset share.

use std::ops::Range;

/// A dimension that is divided into chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Name of the dimension in the dataset.
    pub name: String,
    /// Number of entries, at least 1.
    pub length: usize,
    /// Number of entries per chunk, at least 1; the last chunk may be shorter.
    pub chunk: usize,
}

impl Axis {
    /// Creates an axis. Lengths below 1 become 1, and a chunk is at most as long as the axis.
    pub fn new(name: impl Into<String>, length: usize, chunk: usize) -> Self {
        let length = length.max(1);
        Self {
            name: name.into(),
            length,
            chunk: chunk.clamp(1, length),
        }
    }

    /// Number of chunks along this axis.
    pub fn chunks(&self) -> usize {
        self.length.div_ceil(self.chunk)
    }
}

/// The division of the dimensions of a dataset into chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Axes of the grid, the slowest one first (row-major order).
    pub axes: Vec<Axis>,
}

/// One chunk of a grid: a range of entries along each axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Index of the chunk among all chunks, row-major.
    pub chunk: usize,
    /// Index of the chunk along each axis.
    pub place: Vec<usize>,
    /// Range of entries along each axis.
    pub ranges: Vec<Range<usize>>,
}

impl Block {
    /// Returns the number of entries in the chunk.
    pub fn len(&self) -> usize {
        self.ranges.iter().map(ExactSizeIterator::len).product()
    }

    /// Always false: a chunk has at least one entry.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The entries (one index per axis), row-major.
    pub fn entries(&self) -> impl Iterator<Item = Vec<usize>> + '_ {
        (0..self.len()).map(|flat| self.entry(flat))
    }

    /// The row-major index of an entry; `None` if it is in another chunk.
    pub(super) fn position(&self, entry: &[usize]) -> Option<usize> {
        entry
            .iter()
            .zip(&self.ranges)
            .try_fold(0, |flat, (at, range)| {
                range
                    .contains(at)
                    .then(|| flat * range.len() + (at - range.start))
            })
    }

    /// The entry at the row-major index `flat`.
    pub fn entry(&self, mut flat: usize) -> Vec<usize> {
        let mut entry = vec![0; self.ranges.len()];
        for (slot, range) in entry.iter_mut().zip(&self.ranges).rev() {
            *slot = range.start + flat % range.len();
            flat /= range.len();
        }
        entry
    }
}

impl Grid {
    /// Returns the number of entries over all axes.
    pub fn entries(&self) -> usize {
        self.axes.iter().map(|a| a.length).product()
    }

    /// Returns the number of chunks over all axes.
    pub fn chunks(&self) -> usize {
        self.axes.iter().map(Axis::chunks).product()
    }

    /// Entries of a full chunk.
    pub fn chunk_entries(&self) -> usize {
        self.axes.iter().map(|a| a.chunk).product()
    }

    /// The chunk with the row-major index `chunk`.
    pub fn block(&self, chunk: usize) -> Block {
        let mut rest = chunk;
        let mut place = vec![0; self.axes.len()];
        for (slot, axis) in place.iter_mut().zip(&self.axes).rev() {
            *slot = rest % axis.chunks();
            rest /= axis.chunks();
        }
        let ranges = place
            .iter()
            .zip(&self.axes)
            .map(|(p, a)| p * a.chunk..((p + 1) * a.chunk).min(a.length))
            .collect();
        Block {
            chunk,
            place,
            ranges,
        }
    }

    /// All entries as one block, the chunk of a grid that is not divided.
    pub fn whole(&self) -> Block {
        let whole = |axis: &Axis| Axis::new(&axis.name, axis.length, axis.length);
        let axes = self.axes.iter().map(whole).collect();
        Self { axes }.block(0)
    }

    /// Position in a full chunk of the entry with row-major index `index` of `block`.
    pub(crate) fn slot(&self, block: &Block, index: usize) -> usize {
        block
            .entry(index)
            .iter()
            .zip(block.ranges.iter().zip(&self.axes))
            .fold(0, |slot, (e, (r, a))| slot * a.chunk + (e - r.start))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ten entries in chunks of four give three chunks, the last one short; eight give two.
    #[test]
    fn chunks_are_as_many_and_as_long_as_counted_by_hand() {
        let ranges = |length, chunk| {
            let grid = Grid {
                axes: vec![Axis::new("x", length, chunk)],
            };
            let block = |chunk| grid.block(chunk).ranges[0].clone();
            let all = (0..grid.chunks()).map(|chunk| (block(chunk).start, block(chunk).end));
            all.collect::<Vec<_>>()
        };
        assert_eq!(ranges(10, 4), [(0, 4), (4, 8), (8, 10)]);
        assert_eq!(ranges(8, 4), [(0, 4), (4, 8)]);
        assert_eq!(ranges(3, 9), [(0, 3)]);
        // Two rows by five columns in chunks of two: row-major, as in Zarr's names.
        let axes = vec![Axis::new("y", 2, 1), Axis::new("x", 5, 2)];
        let block = Grid { axes }.block(4);
        assert_eq!((block.place, block.ranges), (vec![1, 1], vec![1..2, 2..4]));
    }

    proptest! {
        /// Every entry of the grid lies in exactly one block, and slots do not collide.
        #[test]
        fn blocks_tile_the_grid(
            sizes in proptest::collection::vec((1usize..8, 1usize..5), 1..4)
        ) {
            let axes = sizes.iter().enumerate()
                .map(|(i, (length, chunk))| Axis::new(format!("d{i}"), *length, *chunk));
            let grid = Grid { axes: axes.collect() };
            let mut seen = std::collections::BTreeSet::new();
            for chunk in 0..grid.chunks() {
                let block = grid.block(chunk);
                let mut slots = std::collections::BTreeSet::new();
                for (index, entry) in block.entries().enumerate() {
                    prop_assert!(seen.insert(entry));
                    let slot = grid.slot(&block, index);
                    prop_assert!(slot < grid.chunk_entries() && slots.insert(slot));
                }
            }
            prop_assert_eq!(seen.len(), grid.entries());
        }
    }
}
