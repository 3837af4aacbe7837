//! Lower bounds of a signal in which only its slowest terms are followed.

/// How many lower bounds are looked at.
pub(crate) const RELAXATIONS: usize = 2;

/// How many of `count` terms the lower bounds follow.
fn followed(count: usize) -> [usize; RELAXATIONS] {
    [2, if count <= 5 { 3 } else { 4 }]
}

/// For each of the terms, whose rates have these sizes, 1 in the lower bounds that follow it and
/// 0 elsewhere.
pub(crate) fn relaxation_masks(sizes: &[f64]) -> Vec<[f64; RELAXATIONS]> {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by(|&a, &b| sizes[a].total_cmp(&sizes[b]));
    let mut masks = vec![[0.0; RELAXATIONS]; sizes.len()];
    for (rank, &k) in order.iter().enumerate() {
        masks[k] = followed(sizes.len()).map(|n| if rank < n { 1.0 } else { 0.0 });
    }
    masks
}
