//! The explorer's answers in a Web Worker: bytes in, bytes out.
//!
//! The worker writes a request into the memory of the module (`room`), asks for its answer (`answer`), and
//! receives it, line by line or whole, through the functions that the module imports. A worker that is no
//! longer needed is ended from outside: nothing here polls for that.

#![cfg(target_family = "wasm")]

use std::sync::LazyLock;

use nanotap::Error;
use nanotap::control::Control;
use nanotap_explorer::{Explorer, Outcome};
use serde_json::{Value, json};

#[link(wasm_import_module = "nanotap")]
unsafe extern "C" {
    /// A line of a streamed answer.
    fn line(start: *const u8, length: usize);
    /// The answer: whether the request was answered, its media type, its content.
    fn reply(answered: u32, kind: *const u8, kind_length: usize, start: *const u8, length: usize);
    /// Loads the functions of the second part of the module, which the page loads on demand.
    fn second();
    /// The words of a panic, after which the module is of no use.
    fn panicked(start: *const u8, length: usize);
}

static EXPLORER: LazyLock<Result<Explorer, Error>> = LazyLock::new(|| {
    std::panic::set_hook(Box::new(|info| {
        let words = info.to_string();
        // SAFETY: the worker copies the bytes before it returns.
        unsafe { panicked(words.as_ptr(), words.len()) };
    }));
    Explorer::new(None)
});

/// Loads the second part of the module: called once, by the functions that are in it.
#[unsafe(no_mangle)]
pub extern "C" fn load() {
    // SAFETY: it takes and returns nothing.
    unsafe { second() };
}

/// Room for a request.
#[unsafe(no_mangle)]
pub extern "C" fn room(length: usize) -> *mut u8 {
    std::mem::ManuallyDrop::new(vec![0; length]).as_mut_ptr()
}

/// Answers the request in the room: `path_length` bytes of its path, then its body.
///
/// # Safety
/// The room has this length, is filled, and is used once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn answer(start: *mut u8, length: usize, path_length: usize) {
    // SAFETY: `room` gave away a vector of this length.
    let bytes = unsafe { Vec::from_raw_parts(start, length, length) };
    let (path, body) = bytes.split_at(path_length.min(length));
    let send = |value: Value| {
        let text = value.to_string();
        // SAFETY: the worker copies the bytes before it returns.
        unsafe { line(text.as_ptr(), text.len()) };
    };
    let control = Control {
        cancel: None,
        progress: None,
    };
    let path = String::from_utf8_lossy(path);
    let (answered, kind, bytes) = match &*EXPLORER {
        Ok(explorer) => {
            let answer = explorer.answer(&path, body, &control, &send);
            (
                answer.outcome == Outcome::Answered,
                answer.kind,
                answer.bytes,
            )
        }
        Err(error) => {
            let refusal = json!({ "error": error.to_string(), "keys": [] });
            (false, "application/json", refusal.to_string().into_bytes())
        }
    };
    // SAFETY: the worker copies the bytes before it returns.
    unsafe {
        reply(
            answered.into(),
            kind.as_ptr(),
            kind.len(),
            bytes.as_ptr(),
            bytes.len(),
        )
    };
}
