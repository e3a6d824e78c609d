//! Numbers and what is done with them: the scalars that the equations are generic over, dual and
//! compensated numbers, polynomials, quadrature, vectors.

pub(crate) mod compensated;
pub(crate) mod dual;
pub mod legendre;
mod plain;
pub(crate) mod polynomial;
pub mod quadrature;
pub(crate) mod scalar;
pub mod vector;
