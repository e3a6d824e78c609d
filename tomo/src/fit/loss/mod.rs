//! Loss of a field: data terms, penalties, and their sum with its gradient.

pub(in crate::fit) mod change_price;
pub(in crate::fit) mod curve_term;
pub(in crate::fit) mod movie_loss;
pub(in crate::fit) mod objective;
pub(in crate::fit) mod regulariser;
pub(in crate::fit) mod scan_term;
pub(in crate::fit) mod terms;
