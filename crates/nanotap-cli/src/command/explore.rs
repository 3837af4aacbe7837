//! `nanotap explore`: the knobs, the motion and what coexists, in a browser.

use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;
use nanotap::case::{Case, file};
use nanotap_explorer::link::{PAGE, link};
use nanotap_server::{Options, serve};

use crate::failure::Failure;
use crate::output::{Output, print};
use crate::progress;

/// Change parameters of a case in a browser and see the motion
///
/// The page is served on this machine only, at the printed address, which contains a token. Stop
/// it with Ctrl-C.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// Case file shown first; default: the paper's case
    #[arg(value_name = "CASE")]
    file: Option<PathBuf>,

    /// Set a key of the case, as in omega=20; may be repeated
    #[arg(long, value_name = "KEY=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,

    /// Port on 127.0.0.1; 0: any that is free
    #[arg(long, value_name = "P", default_value_t = 0)]
    port: u16,

    /// Print the address without opening a browser
    #[arg(long)]
    no_browser: bool,

    /// Print a link that holds the case, for a page that needs no server, and end
    #[arg(long)]
    link: bool,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    if arguments.link {
        let source = arguments.file.as_deref().map(file::read).transpose()?;
        let case = Case::parse(source, &file::with_tables(&arguments.set)?)?;
        return print(&format!("{}\n", link(PAGE, &case.to_toml())));
    }
    let options = Options {
        case: arguments.file.clone(),
        set: arguments.set.clone(),
        port: arguments.port,
    };
    // A page that is served has no end to wait for.
    progress::end();
    serve(&options, |address| {
        // A reader of the pipe waits for this line.
        let mut out = std::io::stdout().lock();
        let _ = writeln!(out, "{}", address.url);
        let _ = out.flush();
        if arguments.no_browser {
            return;
        }
        // A page, because other users can read the command line of the program that opens it.
        let opened = address
            .page()
            .is_ok_and(|page| open::that_detached(page).is_ok());
        output.note(if opened {
            "if no page opens, open the address above in a browser"
        } else {
            "no browser could be opened; open the address above in one"
        });
    })
}
