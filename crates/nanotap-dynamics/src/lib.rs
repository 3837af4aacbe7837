//! Analysis of any periodically forced system through its stroboscopic map:
//! which motions exist, how stable each is, where it is born and dies.
//!
//! Nothing here knows of beams, tips or contact.

pub mod map;
