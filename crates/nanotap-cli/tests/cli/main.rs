//! The program from outside: exit codes, words, JSON and files.

mod case;
mod modes;
mod motions;
mod physical;
mod terminal;
mod util;
