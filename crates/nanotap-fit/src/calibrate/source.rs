//! Spectra and records of the deflection, from instruments' files and tables.

use afm_files::{Curve, Document, Format, Limits, Segment, Style, recognise};
use afm_thermal::{Average, Density, Fluid, Unit};
use nanotap_case::table::{Entry, Header, Table};
use nanotap_error::Error;
use nanotap_quantity::{Kind, Quantity};

use super::unit::{DensityUnit, signal};
use super::{AverageKind, CalibrateOptions};

/// Zero of the Celsius scale, K.
pub(super) const CELSIUS: f64 = 273.15;

/// What was measured.
#[derive(Debug)]
pub(super) enum Signal {
    /// A spectrum in m or V.
    Spectrum {
        frequency: Vec<f64>,
        values: Vec<f64>,
        density: Density,
        unit: Unit,
    },
    /// A record in m or V, at so many samples a second.
    Record {
        samples: Vec<f64>,
        rate: f64,
        unit: Unit,
    },
}

/// What a file states of the measurement.
#[derive(Debug, Default)]
pub(super) struct Stated {
    /// Temperature, K.
    pub(super) temperature: Option<f64>,
    /// Sensitivity, m/V.
    pub(super) sensitivity: Option<f64>,
    pub(super) averages: Option<f64>,
    pub(super) average: Average,
    /// Length and width of the lever, m.
    pub(super) plan: Option<[f64; 2]>,
    pub(super) fluid: Option<Fluid>,
    /// Angle between lever and sample, rad.
    pub(super) tilt: Option<f64>,
}

/// A measurement.
#[derive(Debug)]
pub(super) struct Measurement {
    pub(super) signal: Signal,
    /// Name of the spectrum or channel.
    pub(super) name: String,
    pub(super) stated: Stated,
    /// What was read, and from where.
    pub(super) notes: Vec<String>,
    /// Whether it is a table, not an instrument's file.
    pub(super) is_table: bool,
}

impl Measurement {
    /// Refuses options that have no effect on such a measurement.
    pub(super) fn refuse_without_effect(&self, options: &CalibrateOptions) -> Result<(), Error> {
        let is_spectrum = matches!(self.signal, Signal::Spectrum { .. });
        let (table, file) = (self.is_table, !self.is_table);
        let rows = [
            (
                "spectrum",
                options.spectrum.is_some() && (table || !is_spectrum),
                "names a spectrum of an instrument's file",
            ),
            (
                "column",
                options.column.is_some() && file,
                "names a column of a table",
            ),
            (
                "unit",
                options.unit.is_some() && file && !is_spectrum,
                "is that of a table or of a spectrum; this record states its own",
            ),
            (
                "rate",
                options.rate.is_some() && (file || is_spectrum),
                "is that of deflections in a table",
            ),
            (
                "segment",
                options.segment.is_some() && is_spectrum,
                "is for a record of the deflection; this is a spectrum",
            ),
            (
                "averages",
                options.averages.is_some() && !is_spectrum,
                "is for a spectrum; those of a record follow from its segments",
            ),
            (
                "average",
                options.average != AverageKind::Auto && !is_spectrum,
                "is for a spectrum; of a record powers are averaged",
            ),
            (
                "two_sided",
                options.two_sided && !is_spectrum,
                "is for a spectrum; that of a record is one-sided",
            ),
        ];
        match rows.into_iter().find(|(_, is_useless, _)| *is_useless) {
            Some((name, _, reason)) => Err(Error::option(
                name,
                format!("{{{name}}} has no effect on `{}`: it {reason}", self.name),
                "leave it out",
            )),
            None => Ok(()),
        }
    }
}

/// The unit that an option gives, or the stated one; a note if they differ.
fn unit_of<'a>(
    name: &str,
    stated: &'a str,
    options: &'a CalibrateOptions,
    notes: &mut Vec<String>,
) -> &'a str {
    let Some(given) = options.unit.as_deref() else {
        return stated;
    };
    if !stated.is_empty() && given != stated {
        notes.push(format!(
            "`{name}` is read in \"{given}\", as the options say; its own unit is \"{stated}\""
        ));
    }
    given
}

/// Reads the content of an instrument's file, or of a table as text.
pub(super) fn of_bytes(
    name: &str,
    bytes: Vec<u8>,
    options: &CalibrateOptions,
) -> Result<Measurement, Error> {
    if recognise(&bytes).is_none() {
        return of_table(&Table::of_bytes(name, bytes, None)?, options);
    }
    let refuse = |message: String| {
        Error::input(
            format!("{name}: {message}"),
            "`nanotap files` lists what a file holds",
        )
    };
    let document = afm_files::read_within(bytes, Limits::default());
    let document = document.map_err(|error| refuse(error.to_string()))?;
    let mut found = if document.spectra.is_empty() {
        of_curve(&document).map_err(refuse)?
    } else {
        of_spectra(&document, options)?
    };
    found.notes.extend(document.notes.iter().cloned());
    Ok(found)
}

/// The requested spectrum of a file; else the one called `average`, else the first.
fn of_spectra(document: &Document, options: &CalibrateOptions) -> Result<Measurement, Error> {
    let named = |name: &str| document.spectra.iter().find(|of| of.name == name);
    let spectrum = match &options.spectrum {
        Some(name) => {
            let by_number = || document.spectra.get(name.parse::<usize>().ok()?);
            named(name).or_else(by_number).ok_or_else(|| {
                let known: Vec<&str> = document.spectra.iter().map(|of| of.name.as_str()).collect();
                Error::option(
                    "spectrum",
                    format!("no spectrum `{name}`"),
                    format!("there are {}", known.join(", ")),
                )
            })?
        }
        None => named("average").unwrap_or(&document.spectra[0]),
    };
    let mut notes = Vec::new();
    let text = unit_of(&spectrum.name, &spectrum.unit, options, &mut notes);
    let unit = DensityUnit::read(text).ok_or_else(|| no_density(&spectrum.name, text))?;
    let stated = stated(document, &mut notes);
    Ok(Measurement {
        signal: Signal::Spectrum {
            frequency: spectrum.frequency.clone(),
            values: spectrum.values.iter().map(|of| unit.in_si(*of)).collect(),
            density: unit.density,
            unit: unit.unit,
        },
        name: spectrum.name.clone(),
        stated,
        notes,
        is_table: false,
    })
}

fn no_density(name: &str, unit: &str) -> Error {
    Error::option(
        "unit",
        format!("`{name}` has the unit \"{unit}\", which is not that of a spectral density"),
        "expected a unit such as \"V^2/Hz\", \"pm^2/Hz\", \"V/sqrt(Hz)\" or \"fm/sqrt(Hz)\"",
    )
}

/// What JPK's and Nanosurf's files state.
fn stated(document: &Document, notes: &mut Vec<String>) -> Stated {
    let setting = |name: &str| {
        let is_it = |own: &str| own == name || own.rsplit('\\').next() == Some(name);
        let found = document.settings.iter().find(|(own, _)| is_it(own));
        found.map(|(_, value)| value.as_str())
    };
    let quantity = |name: &str, kind: Kind| kind.parse(setting(name)?).ok();
    // The number at the beginning: units are written as `℃`, `°` or badly encoded.
    let number = |name: &str| leading_number(setting(name)?);
    let mut stated = Stated::default();
    match document.format {
        Format::JpkThermal => {
            stated.temperature = number("settings.temperature").map(|of| of + CELSIUS);
            stated.sensitivity = quantity("sensitivity", super::SENSITIVITY);
            stated.plan = quantity("cantilever.length", Kind::Length)
                .zip(quantity("cantilever.width", Kind::Length))
                .map(<[f64; 2]>::from);
            stated.fluid = quantity("settings.environment density", Kind::Density)
                .zip(quantity("settings.environment viscosity", Kind::Viscosity))
                .map(|(density, viscosity)| Fluid { density, viscosity });
            // As in `10° + 0.0 °`.
            let angles = setting("cantilever.angle").map(|text| text.split('+'));
            let angles = angles.map(|parts| parts.filter_map(leading_number).sum::<f64>());
            stated.tilt = angles.map(f64::to_radians);
            if let Some(factor) = number("cantilever.correction factor") {
                notes.push(format!(
                    "the file has the correction factor {factor}, which is used only if it is given as the option"
                ));
            }
        }
        Format::Nanosurf => {
            stated.temperature = number("Cantilever temperature").map(|of| of + CELSIUS);
            stated.averages = number("Averages").filter(|of| *of >= 1.0);
            // The scatter of its spectra shows it.
            stated.average = Average::Amplitudes;
            notes
                .push("Nanosurf averages amplitudes: the density is corrected for that".to_owned());
        }
        _ => {}
    }
    stated
}

fn leading_number(text: &str) -> Option<f64> {
    let text = text.trim_start();
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.' && c != '-');
    text[..end.unwrap_or(text.len())].parse().ok()
}

/// The deflection of the longest segment of the first curve in which the lever rests.
fn of_curve(document: &Document) -> Result<Measurement, String> {
    if document.curve_count() == 0 {
        return Err("it has neither a spectrum nor a record of the deflection".to_owned());
    }
    let curve = document.curve(0).map_err(|error| error.to_string())?;
    let rests = |of: &&Segment| matches!(of.style, Style::Pause | Style::Unsplit);
    let longest = |all: Vec<&'_ Segment>| -> Option<Segment> {
        all.into_iter().max_by_key(|of| of.points()).cloned()
    };
    let resting: Vec<&Segment> = curve.segments.iter().filter(rests).collect();
    let segment = longest(resting).or_else(|| longest(curve.segments.iter().collect()));
    let segment = segment.ok_or_else(|| "its first curve has no segment".to_owned())?;
    let rate = segment
        .duration
        .filter(|of| *of > 0.0)
        .map(|duration| segment.points() as f64 / duration);
    let rate = rate.ok_or_else(|| "its segment has no duration".to_owned())?;
    record(&curve, &segment, rate)
}

fn record(curve: &Curve, segment: &Segment, rate: f64) -> Result<Measurement, String> {
    let channel = curve.deflection_in(segment);
    let channel = channel.ok_or_else(|| "its segment has no deflection".to_owned())?;
    let (unit, factor) = signal(&channel.unit).ok_or_else(|| {
        format!(
            "its deflection `{}` has the unit \"{}\", expected m or V",
            channel.name, channel.unit
        )
    })?;
    let mut notes = vec![format!(
        "spectrum of {} samples of `{}` at {}",
        channel.values.len(),
        channel.name,
        Kind::Frequency.format(rate)
    )];
    if !matches!(segment.style, Style::Pause | Style::Unsplit) {
        notes.push("the lever moves during this record; record it at rest".to_owned());
    }
    Ok(Measurement {
        signal: Signal::Record {
            samples: channel.values.iter().map(|of| factor * of).collect(),
            rate,
            unit,
        },
        name: channel.name.clone(),
        stated: Stated {
            sensitivity: curve.sensitivity,
            ..Stated::default()
        },
        notes,
        is_table: false,
    })
}

/// A table with a frequency and a density, or with a time (or a sampling rate) and a deflection.
pub(super) fn of_table(table: &Table, options: &CalibrateOptions) -> Result<Measurement, Error> {
    let headers: Vec<Header> = table.columns.iter().map(|(of, _)| Header::of(of)).collect();
    let is_of = |header: &Header, kind: Kind| {
        let quantity = format!("1 {}", header.unit).parse::<Quantity>();
        quantity.is_ok_and(|of| !header.unit.is_empty() && of.dimension == kind.dimension())
    };
    let begins = |header: &Header, words: &[&str]| {
        let name = header.name.to_lowercase();
        header.unit.is_empty() && words.iter().any(|word| name.starts_with(word))
    };
    let abscissa = |kind: Kind, words: &[&str]| {
        headers
            .iter()
            .position(|of| is_of(of, kind))
            .or_else(|| headers.iter().position(|of| begins(of, words)))
    };
    let frequency = abscissa(Kind::Frequency, &["freq", "f ("]);
    let time = abscissa(Kind::Time, &["time"]);
    let remarks = table.remarks.iter().cloned();
    let mut notes: Vec<String> = remarks.collect();
    let wanted = |default: Option<usize>, what: &str| {
        let requested = options.column.as_deref().map(|name| {
            let is_called = |(header, _): &(String, Vec<Entry>)| Header::is_called(header, name);
            table.columns.iter().position(is_called).ok_or_else(|| {
                Error::option(
                    "column",
                    format!("{} has no column `{name}`", table.name),
                    format!("its columns are {}", names(table)),
                )
            })
        });
        match requested {
            Some(found) => found,
            None => default.ok_or_else(|| {
                Error::input(
                    format!("{} has no column with {what}", table.name),
                    format!(
                        "its columns are {}; name the unit in brackets, as in `PSD (m^2/Hz)`, or give {{column}} \
                         and {{unit}}",
                        names(table)
                    ),
                )
            }),
        }
    };
    if let Some(frequency) = frequency.filter(|_| options.rate.is_none()) {
        let is_density = |header: &Header| DensityUnit::read(&header.unit).is_some();
        let other = || (0..headers.len()).find(|k| *k != frequency);
        let default = headers.iter().position(is_density);
        let default = default.or_else(|| options.unit.as_ref().and_then(|_| other()));
        let column = wanted(default, "a spectral density")?;
        let Header { name, unit } = &headers[column];
        let text = unit_of(name, unit, options, &mut notes);
        let unit = DensityUnit::read(text).ok_or_else(|| no_density(name, text))?;
        let factor = Kind::Frequency.parse(&format!("1 {}", headers[frequency].unit));
        let factor = factor.unwrap_or(1.0);
        let rows = rows(table, &[frequency, column])?;
        return Ok(Measurement {
            signal: Signal::Spectrum {
                frequency: rows.iter().map(|row| factor * row[0]).collect(),
                values: rows.iter().map(|row| unit.in_si(row[1])).collect(),
                density: unit.density,
                unit: unit.unit,
            },
            name: headers[column].name.clone(),
            stated: Stated::default(),
            notes,
            is_table: true,
        });
    }
    let is_signal = |header: &Header| signal(&header.unit).is_some();
    let column = wanted(
        headers.iter().position(is_signal),
        "frequencies and spectral densities, or deflections in m or V",
    )?;
    let Header { name, unit } = &headers[column];
    let text = unit_of(name, unit, options, &mut notes);
    let (unit, factor) = signal(text).ok_or_else(|| {
        Error::option(
            "unit",
            format!("`{name}` has the unit \"{text}\""),
            "expected a unit of the deflection such as \"nm\" or \"V\"",
        )
    })?;
    let (samples, rate) = match (
        super::amount("rate", options.rate.as_ref(), Kind::Frequency)?,
        time,
    ) {
        (Some(rate), _) => {
            let rows = rows(table, &[column])?;
            (rows.into_iter().map(|row| row[0]).collect(), rate)
        }
        (None, Some(time)) => {
            let scale = Kind::Time
                .parse(&format!("1 {}", headers[time].unit))
                .unwrap_or(1.0);
            let rows = rows(table, &[time, column])?;
            let ends = rows.first().zip(rows.last());
            let duration = ends.map_or(0.0, |(first, last)| scale * (last[0] - first[0]));
            let rate = (rows.len() as f64 - 1.0) / duration;
            let samples: Vec<f64> = rows.into_iter().map(|row| row[1]).collect();
            (samples, rate)
        }
        (None, None) => {
            return Err(Error::input(
                format!("{} has neither a time nor a frequency", table.name),
                "give the sampling rate of the record: {rate}, as in \"1 MHz\"",
            ));
        }
    };
    Ok(Measurement {
        signal: Signal::Record {
            samples: samples.into_iter().map(|of: f64| factor * of).collect(),
            rate,
            unit,
        },
        name: headers[column].name.clone(),
        stated: Stated::default(),
        notes,
        is_table: true,
    })
}

fn names(table: &Table) -> String {
    let names: Vec<String> = table
        .columns
        .iter()
        .map(|(header, _)| format!("`{header}`"))
        .collect();
    names.join(", ")
}

/// The numbers of these columns, without rows in which one is missing.
fn rows(table: &Table, columns: &[usize]) -> Result<Vec<Vec<f64>>, Error> {
    let mut rows = Vec::new();
    'rows: for row in 0..table.rows() {
        let mut numbers = Vec::with_capacity(columns.len());
        for &column in columns {
            match table.columns[column].1.get(row) {
                Some(Entry::Number(number)) => numbers.push(*number),
                Some(Entry::Missing) | None => continue 'rows,
                Some(Entry::Text(text)) => {
                    return Err(Error::input(
                        format!(
                            "{}: expected a number, got `{text}`",
                            table.place(Some(row), column)
                        ),
                        "leave missing values empty",
                    ));
                }
            }
        }
        rows.push(numbers);
    }
    Ok(rows)
}
