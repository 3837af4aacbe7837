//! `nanotap window`: the operating window, where the lever taps with one motion only.
//!
//! "Window" is what people at the instrument call the range of setpoints and drives in which
//! imaging is stable.

use clap::Args;
use nanotap::case::Key;
use nanotap::figure::window::figure;
use nanotap::study::DatasetStudy as _;
use nanotap::study::window::{WindowOptions, WindowStudy};

use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::{DatasetArguments, derived_name};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::number;
use crate::output::Output;
use crate::page::paragraph;
use crate::request::Request;
use crate::targets;
use crate::text_table::Table;

/// The operating window over two parameters: where there is only one motion, and where a second
/// state, subharmonics or chaos threaten.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<WindowOptions>,

    #[command(flatten)]
    dataset: DatasetArguments,
    #[command(flatten)]
    plot: PlotArgument,
}

/// Most points of which the states at the setpoint are printed one by one.
const SHOWN_POINTS: usize = 36;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let options = arguments.request.read()?;
    let names = options.over.names();
    let any_distance = WindowStudy::any_distance(&options);
    let implied = options.over.first_values();
    let case = GivenCase::with_implied(&arguments.case, &implied, any_distance, output)?;
    let over = options.over.parse(&case)?;
    let mut keys: Vec<Key> = over.iter().map(|over| over.key).collect();
    if case.leaves_distance_to_setpoint() && !keys.contains(&Key::DriveSetpoint) {
        // The distance is solved at each point.
        keys.push(Key::DriveSetpoint);
    }
    case.note_constants(&keys, output);
    let name = derived_name(
        arguments.case.file.as_deref(),
        &[&["window"], names.as_slice()].concat(),
    );
    let done = arguments.dataset.run::<WindowStudy>(
        &case,
        &options,
        &name,
        WindowStudy::COUNTED,
        options.seed,
        &arguments.plot,
        figure,
        output,
    )?;
    output.study(&case, &done, |done| {
        let heading = format!(
            "{}: operating window over {} and {}, {} at each of {} points",
            case.title(),
            names[0],
            names[1],
            number::counted(options.starts, "start", "starts"),
            over.iter().map(|over| over.count).product::<usize>()
        );
        done.text(&heading, |window| {
            let targets = window.targets.as_ref();
            let targets = targets.map(|found| targets::text(found, &over));
            let unreached = targets::unreached(&window.unreached, &over);
            let setpoint = window.setpoint.as_ref().map(|map| {
                let table = Table::all(&map.point_table());
                let is_short = map.points.iter().flatten().count() <= SHOWN_POINTS;
                let table = if is_short {
                    table.render()
                } else {
                    String::new()
                };
                format!("{table}{}", paragraph(&map.verdict))
            });
            format!(
                "{}{}{unreached}{}",
                Table::all(&window.share_table()).render(),
                setpoint.unwrap_or_default(),
                targets.unwrap_or_default()
            )
        })
    })
}
