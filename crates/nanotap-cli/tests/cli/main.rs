//! The program from outside: exit codes, words, JSON and files.

mod case;
mod terminal;
mod util;
