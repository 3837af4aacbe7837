//! What most studies take: a case, a request, and where table and picture go.

use clap::Args;
use nanotap::case::Case;
use nanotap::frame::Frame;
use nanotap::study::Study;

use crate::arguments::{CaseArguments, OutArgument, PlotArgument};
use crate::failure::Failure;
use crate::file;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::request::Request;

/// The arguments of a study.
#[derive(Args, Debug)]
pub(crate) struct StudyArguments<S: Study> {
    #[command(flatten)]
    pub(crate) case: CaseArguments,

    #[command(flatten)]
    pub(crate) request: Request<S::Options>,

    #[command(flatten)]
    pub(crate) out: OutArgument,
    #[command(flatten)]
    pub(crate) plot: PlotArgument,
}

impl<S: Study> StudyArguments<S> {
    /// The options and the case, once it is known that table and picture can be written.
    pub(crate) fn read(&self, output: &Output) -> Result<(S::Options, GivenCase), Failure> {
        let options = self.options()?;
        let case = GivenCase::for_study(&self.case, S::ANY_DISTANCE, output)?;
        Ok((options, case))
    }

    /// As [`read`](Self::read), for a study that varies a key, which the case may lack: `first` returns
    /// its first value as a `key=value` word.
    pub(crate) fn read_varied(
        &self,
        first: impl FnOnce(&S::Options) -> String,
        output: &Output,
    ) -> Result<(S::Options, GivenCase), Failure> {
        let options = self.options()?;
        let first = [first(&options)];
        let case = GivenCase::with_implied(&self.case, &first, S::ANY_DISTANCE, output)?;
        Ok((options, case))
    }

    fn options(&self) -> Result<S::Options, Failure> {
        let options = self.request.read()?;
        self.out.check()?;
        self.plot.check()?;
        Ok(options)
    }

    /// Writes the table and the figure of a report where `--out` and `--plot` want them.
    pub(crate) fn write(&self, case: &Case, report: &S::Report) -> Result<(), Failure> {
        let table = || S::frames(case, report).first().map(Frame::csv);
        self.out.write(|| table().unwrap_or_default())?;
        self.draw(case, report)
    }

    /// Draws the figure of a report where `--plot` wants it.
    pub(crate) fn draw(&self, case: &Case, report: &S::Report) -> Result<(), Failure> {
        match &self.plot.plot {
            Some(path) => {
                S::figure(case, report).map_or(Ok(()), |figure| file::draw(path, &figure))
            }
            None => Ok(()),
        }
    }
}
