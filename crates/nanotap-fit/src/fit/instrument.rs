//! Tables as instruments write them: names and units of their columns, the direction of the
//! distance, approach and retract in one column, and zero and sign of the phase.
//!
//! Conversions are stated (`Amp=58 nm/V`, `Phase=90-x`) or guessed; every guess is reported, and what
//! is stated is not guessed. A table whose columns follow nanotap's own conventions stays as it is.

use nanotap_arithmetic::ComplexFunctions as _;

use nanotap_case::physical::Kind;
use nanotap_case::physical::free_response::free_response;
use nanotap_case::table::{DECIMAL_COMMAS, Entry, Header, Table};
use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_motions::approach::Way;
use nanotap_quantity::number::shortest;

use super::data;
use super::quantity::Quantity;

/// Names of instruments' columns, in lower case without blanks, and what they are called here. Of
/// several with the same meaning the first counts.
const NAMES: [(&str, &str); 43] = [
    ("amp", "amplitude"),
    ("amp1", "amplitude"),
    ("amplitude1", "amplitude"),
    ("lockinamplitude", "amplitude"),
    ("lock-inamplitude", "amplitude"),
    ("phase1", "phase"),
    ("phas1", "phase"),
    ("lockinphase", "phase"),
    ("lock-inphase", "phase"),
    ("r", "amplitude"),
    ("theta", "phase"),
    ("zsnsr", "distance"),
    ("zsensor", "distance"),
    ("heightsensor", "distance"),
    ("capacitivesensorheight", "distance"),
    ("measuredheight", "distance"),
    ("straingaugeheight", "distance"),
    ("z-sense", "distance"),
    ("height(measured)", "distance"),
    ("zpiezo", "distance"),
    ("piezo", "distance"),
    ("height", "distance"),
    ("z-axissensor", "distance"),
    ("z-axis", "distance"),
    ("z", "distance"),
    ("zposition", "distance"),
    ("commandedz", "distance"),
    ("ramp", "distance"),
    ("displacement", "distance"),
    ("separation", "distance"),
    ("df", "frequency_shift"),
    ("freqshift", "frequency_shift"),
    ("frequencyshift", "frequency_shift"),
    ("defl", "deflection"),
    ("deflsensor", "deflection"),
    ("verticaldeflection", "deflection"),
    ("vdeflection", "deflection"),
    ("cantileverdeflection", "deflection"),
    ("tipdeflection", "deflection"),
    ("deflectionerror", "deflection"),
    ("cantilever", "deflection"),
    ("t-b", "deflection"),
    ("dfl", "deflection"),
];
/// Columns that a force curve does not need.
const OF_FORCE_CURVE: [&str; 3] = ["separation", "time", "contact"];

/// The free phase is the instrument's own where it is this far from the lever's, in degrees.
const OWN_PHASE: f64 = 15.0;
/// Fewest rows from which anything is guessed.
const MIN_ROWS: usize = 12;

/// Measured tables with the names and units that are known here.
pub struct Prepared {
    /// The tables.
    pub tables: Vec<Table>,
    /// The columns to use, by their present names.
    pub columns: Vec<String>,
    /// Sentences on conversions and guesses that were applied to the tables.
    pub notes: Vec<String>,
    /// Whether the zero of a phase was guessed.
    pub(crate) guessed_phase: bool,
    /// What the distance and the deflection of each table are in its file.
    pub(crate) channels: Vec<Channels>,
}

/// What the columns of a force curve are in its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channels {
    /// Name of the table.
    pub(crate) table: String,
    /// Name of the distance.
    pub(crate) distance: String,
    /// Whether the distance grows towards the sample in the file.
    pub(crate) is_reversed: bool,
    /// Name of the deflection or the force.
    pub(crate) deflection: String,
    /// Stiffness of the lever in the header, N/m.
    pub(crate) spring_constant: Option<f64>,
    /// Sensitivity in the header, m/V.
    pub(crate) sensitivity: Option<f64>,
    /// How many rows are fitted, before they are averaged.
    pub(crate) rows: usize,
}

impl Channels {
    /// The channels of a prepared table; `renamed` columns have their names of the file.
    fn of(table: &Table, renamed: &[(String, String)], is_reversed: bool) -> Self {
        let name = |names: &[&str]| {
            let place = place_of(table, names)?;
            let present = Header::of(&table.columns[place].0).name;
            let own = renamed.iter().find(|(known, _)| *known == present);
            Some(own.map_or(present, |(_, own)| own.clone()))
        };
        Self {
            table: table.name.clone(),
            distance: name(&["distance", "zc", "gap", "gap.tip"]).unwrap_or_default(),
            is_reversed,
            deflection: name(&READ).unwrap_or_default(),
            spring_constant: noted(table, SPRING_CONSTANT),
            sensitivity: noted(table, SENSITIVITIES[0].1),
            rows: read_rows(table),
        }
    }
}

/// Names of what a force curve reads.
const READ: [&str; 2] = ["deflection", "force"];

/// Number of rows with a deflection or a force; of a table without these, of all rows.
fn read_rows(table: &Table) -> usize {
    place_of(table, &READ).map_or_else(
        || table.rows(),
        |place| {
            let is_number = |entry: &&Entry| matches!(entry, Entry::Number(x) if x.is_finite());
            table.columns[place].1.iter().filter(is_number).count()
        },
    )
}

/// Properties of a table that the request states, so that they are not guessed.
#[derive(Clone, Copy, Debug, Default)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "four questions, each answered by itself"
)]
struct Stated {
    /// Any conversion: the table is an instrument's.
    any: bool,
    direction: bool,
    zero: bool,
    phase: bool,
}

/// `tables` with the conversions, each of the form `NAME=RULE`, and then the guesses. `columns`
/// are the names of those to use, as in the file; none: all.
///
/// # Errors
/// When a conversion is not understood, no table has its column, or a voltage cannot be converted.
pub fn prepared(
    case: &Case,
    tables: &[Table],
    conversions: &[String],
    columns: &[String],
) -> Result<Prepared, Error> {
    let tables = tables.iter().cloned().map(Table::checked);
    let mut tables = tables.collect::<Result<Vec<Table>, Error>>()?;
    let mut columns = columns.to_vec();
    let mut stated = vec![Stated::default(); tables.len()];
    let mut notes = Vec::new();
    for text in conversions {
        let conversion = Conversion::parse(text)?;
        let mut used = false;
        for (table, stated) in tables.iter_mut().zip(&mut stated) {
            if conversion.apply(table)? {
                used = true;
                conversion.note(stated);
            }
        }
        if !used {
            let names: Vec<String> = tables
                .iter()
                .flat_map(|table| &table.columns)
                .map(|(written, _)| Header::of(written).name)
                .collect();
            return Err(Error::option(
                "convert",
                format!("no column is called `{}`", conversion.name),
                format!("the columns are {}", names.join(", ")),
            ));
        }
        if let Some(renamed) = &conversion.renamed {
            follow(&mut columns, &conversion.name, renamed);
        }
        notes.push(format!("converted as stated: {text}"));
    }
    let mut guessed_phase = false;
    let mut channels = Vec::new();
    for (table, stated) in tables.iter_mut().zip(stated) {
        let comma = table.notes.iter().find(|(name, _)| name == DECIMAL_COMMAS);
        notes.extend(comma.map(|(_, note)| format!("{}: {note}", table.name)));
        let remarks = table.remarks.iter();
        notes.extend(remarks.map(|remark| format!("{}: {remark}", table.name)));
        let renamed = rename(table, &mut columns, &mut notes);
        let foreign = !renamed.is_empty() || stated.any;
        from_header(case, table, &mut notes);
        force_of_deflection(table, &mut columns, &mut notes);
        leave_out_rows(case, table, &columns, &mut notes);
        if is_force_curve(table) {
            force_curve(case, table, &columns, &renamed, &mut notes)?;
        }
        if foreign {
            leave_out(case, table, &columns, &mut notes);
        }
        guessed_phase |= guess(case, table, &renamed, foreign, stated, &mut notes)?;
        let is_reversed = guess_force_curve(case, table, stated, &mut notes);
        let of_table = Channels::of(table, &renamed, is_reversed);
        let unread = table.rows() - of_table.rows;
        if unread > 0 {
            notes.push(rows_left_out(&table.name, &of_table.deflection, unread));
        }
        channels.push(of_table);
        for (place, (written, _)) in table.columns.iter().enumerate() {
            if is_chosen(written, &columns) && data::is_length(&Header::of(written), case) {
                check_volts(table, place, &renamed)?;
            }
        }
    }
    Ok(Prepared {
        tables,
        columns,
        notes,
        guessed_phase,
        channels,
    })
}

/// Keeps the selection of a column that is renamed.
fn follow(columns: &mut [String], before: &str, after: &str) {
    for column in columns {
        if Header::is_called(column, before) || Header::is_called(before, column) {
            after.clone_into(column);
        }
    }
}

/// Whether a column is used.
fn is_chosen(written: &str, columns: &[String]) -> bool {
    columns.is_empty() || columns.iter().any(|name| Header::is_called(written, name))
}

/// Leaves out the rows without a position.
fn leave_out_rows(case: &Case, table: &mut Table, columns: &[String], notes: &mut Vec<String>) {
    let headers: Vec<Header> = table.columns.iter().map(|(h, _)| Header::of(h)).collect();
    if data::of_approach(&headers) {
        return;
    }
    for (place, header) in headers.iter().enumerate() {
        let (written, values) = &table.columns[place];
        if !is_chosen(written, columns) || !data::is_position(header, case) {
            continue;
        }
        let is_missing = |row| matches!(values.get(row), None | Some(Entry::Missing));
        let is_given: Vec<bool> = (0..table.rows()).map(|row| !is_missing(row)).collect();
        let count = is_given.iter().filter(|is_given| !**is_given).count();
        if count > 0 {
            table.retain_rows(|row| is_given[row]);
            notes.push(rows_left_out(&table.name, &header.name, count));
        }
    }
}

/// Says how many rows of a table have no entry in a column.
fn rows_left_out(table: &str, column: &str, count: usize) -> String {
    format!("{table}: rows without `{column}`, left out: {count}")
}

/// A deflection in a unit of force is the force.
fn force_of_deflection(table: &mut Table, columns: &mut [String], notes: &mut Vec<String>) {
    let Some(place) = place_of(table, &["deflection"]) else {
        return;
    };
    let Header { name, unit } = Header::of(&table.columns[place].0);
    let is_force = !unit.is_empty() && Kind::Force.parse(&format!("1 {unit}")).is_ok();
    if is_force && place_of(table, &["force"]).is_none() {
        follow(columns, &name, "force");
        table.columns[place].0 = written("force", &unit);
        let table = &table.name;
        notes.push(format!("{table}: `{name}` is in {unit}: it is the force"));
    }
}

/// Units of a detector's current.
const CURRENTS: [&str; 6] = ["A", "mA", "uA", "µA", "nA", "pA"];

/// Refuses a column in V or A, with the conversion that it needs.
fn check_volts(table: &Table, place: usize, renamed: &[(String, String)]) -> Result<(), Error> {
    let Header { name, unit } = Header::of(&table.columns[place].0);
    let is_voltage = Kind::Voltage.parse(&format!("1 {unit}")).is_ok();
    if unit.is_empty() || !(is_voltage || CURRENTS.contains(&unit.as_str())) {
        return Ok(());
    }
    let place = table.place(None, place);
    Err(Error::input(
        format!("{place}: it is in {unit}, and a length is needed"),
        sensitivity(&name, &unit, renamed),
    ))
}

/// How to state the sensitivity of a column in V.
fn sensitivity(name: &str, unit: &str, renamed: &[(String, String)]) -> String {
    let own = renamed.iter().find(|(present, _)| present == name);
    let own = own.map_or(name, |(_, own)| own);
    let deflects = name.eq_ignore_ascii_case("deflection");
    let of = if deflects { " (InvOLS)" } else { "" };
    format!("give its sensitivity{of}, as in {{convert}} \"{own}=58 nm/{unit}\"")
}

/// Leaves out an instrument's columns that are not understood, if no selection was made.
fn leave_out(case: &Case, table: &mut Table, columns: &[String], notes: &mut Vec<String>) {
    if !columns.is_empty() {
        return;
    }
    let mut lost = Vec::new();
    table.columns.retain(|(written, _)| {
        let header = Header::of(written);
        let is_known = data::is_known(&header, case);
        if !is_known {
            lost.push(format!("`{}`", header.name));
        }
        is_known
    });
    if !lost.is_empty() {
        let (name, lost) = (&table.name, lost.join(", "));
        notes.push(format!("{name}: not understood and left out: {lost}"));
    }
}

/// Conversion of a column, from the option `convert`.
#[derive(Clone, Debug, PartialEq)]
pub struct Conversion {
    /// Name of the column, as written.
    pub name: String,
    /// Value = `offset` + `factor` · x.
    pub factor: f64,
    /// Value at x = 0.
    pub offset: f64,
    /// Units from and to, where the rule states them.
    units: Option<[String; 2]>,
    /// New name of the column, if the rule renames it.
    pub renamed: Option<String>,
}

const RULES: &str = "write NAME=RULE with a rule as in 58 nm/V, 90-x, -x, 1.02*x or amplitude";

impl Conversion {
    /// Reads `NAME=RULE`, as in `phase=90-x` or `Deflection=58 nm/V`.
    ///
    /// # Errors
    /// When a side is empty or the rule is none.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let wrong = |what: String| Error::option("convert", what, RULES);
        let (name, rule) = text
            .split_once('=')
            .ok_or_else(|| wrong(format!("`{text}` has no `=`")))?;
        let (name, rule) = (name.trim().to_owned(), rule.trim());
        if name.is_empty() || rule.is_empty() {
            return Err(wrong(format!("`{text}` has an empty side")));
        }
        let plain = Self {
            name,
            factor: 1.0,
            offset: 0.0,
            units: None,
            renamed: None,
        };
        if let Some((factor, offset)) = linear(rule) {
            return Ok(Self {
                factor,
                offset,
                ..plain
            });
        }
        if let Some((number, rest)) = leading_number(rule)
            && let Some((to, from)) = rest.trim().split_once('/')
            && number != 0.0
        {
            return Ok(Self {
                factor: number,
                units: Some([from.trim().to_owned(), to.trim().to_owned()]),
                ..plain
            });
        }
        if rule
            .chars()
            .all(|c| c.is_alphanumeric() || c == '_' || c == '.')
            && rule.starts_with(|c: char| c.is_alphabetic())
        {
            return Ok(Self {
                renamed: Some(rule.to_owned()),
                ..plain
            });
        }
        Err(wrong(format!("`{rule}` is not a conversion")))
    }

    /// Notes what the conversion states.
    fn note(&self, stated: &mut Stated) {
        let plain = plain(&Header::of(&self.name).name);
        let known = NAMES.iter().find(|(own, _)| *own == plain);
        let name = self.renamed.as_deref().or(known.map(|(_, name)| *name));
        stated.any = true;
        match name.unwrap_or(&plain) {
            _ if self.renamed.is_some() => {}
            "distance" | "zc" | "gap" => {
                stated.direction = true;
                stated.zero |= self.offset != 0.0;
            }
            "phase" => stated.phase = true,
            _ => {}
        }
    }

    /// The unit of converted values that are in `unit`.
    ///
    /// # Errors
    /// When the rule converts another unit; the message begins with the place.
    pub fn unit(&self, unit: &str, place: impl FnOnce() -> String) -> Result<String, Error> {
        match &self.units {
            Some([from, to]) if unit.is_empty() || unit == *from => Ok(to.clone()),
            Some([from, _]) => Err(Error::option(
                "convert",
                format!("{}: it is in {unit}, the rule converts {from}", place()),
                format!("write the factor per {unit}"),
            )),
            None => Ok(unit.to_owned()),
        }
    }

    /// Converts the column of `table` that has the name, if one does.
    fn apply(&self, table: &mut Table) -> Result<bool, Error> {
        let place = |name: &str| {
            let mut columns = table.columns.iter();
            columns.position(|(written, _)| Header::is_called(written, name))
        };
        let place = place(&self.name).or_else(|| place(&Header::of(&self.name).name));
        let Some(place) = place else {
            return Ok(false);
        };
        let header = Header::of(&table.columns[place].0);
        let unit = self.unit(&header.unit, || table.place(None, place))?;
        let name = self.renamed.as_ref().unwrap_or(&header.name);
        let column = &mut table.columns[place];
        column.0 = written(name, &unit);
        for entry in &mut column.1 {
            if let Entry::Number(x) = entry {
                *x = self.offset + self.factor * *x;
            }
        }
        Ok(true)
    }
}

fn written(name: &str, unit: &str) -> String {
    if unit.is_empty() {
        name.to_owned()
    } else {
        format!("{name} ({unit})")
    }
}

/// The number that a text begins with, and the rest.
fn leading_number(text: &str) -> Option<(f64, &str)> {
    let ends = text.char_indices().map(|(at, _)| at).chain([text.len()]);
    let mut numbers = ends.filter_map(|end| Some((text[..end].parse::<f64>().ok()?, &text[end..])));
    numbers.rfind(|(number, _)| number.is_finite())
}

/// Factor and offset of a rule that is linear in x: a sum of two terms, one of them in x.
fn linear(rule: &str) -> Option<(f64, f64)> {
    let rule: String = rule.chars().filter(|c| !c.is_whitespace()).collect();
    let (mut factor, mut offset) = (None, None);
    let mut rest = rule.as_str();
    while !rest.is_empty() {
        let (sign, unsigned) = match rest.strip_prefix('-') {
            Some(unsigned) => (-1.0, unsigned),
            None => (1.0, rest.strip_prefix('+').unwrap_or(rest)),
        };
        if let Some(after) = unsigned.strip_prefix('x') {
            let (number, after) = match after.strip_prefix('/') {
                Some(divisor) => {
                    let (divisor, after) = leading_number(divisor)?;
                    (1.0 / divisor, after)
                }
                None => match after.strip_prefix('*') {
                    Some(times) => leading_number(times)?,
                    None => (1.0, after),
                },
            };
            (factor.is_none() && number.is_finite()).then_some(())?;
            factor = Some(sign * number);
            rest = after;
        } else {
            let (number, after) = leading_number(unsigned)?;
            if let Some(after) = after.strip_prefix("*x") {
                factor.is_none().then_some(())?;
                factor = Some(sign * number);
                rest = after;
            } else {
                offset.is_none().then_some(())?;
                offset = Some(sign * number);
                rest = after;
            }
        }
        (rest.is_empty() || rest.starts_with(['+', '-'])).then_some(())?;
    }
    let factor = factor.filter(|factor| *factor != 0.0)?;
    Some((factor, offset.unwrap_or(0.0)))
}

/// A name of a column as in [`NAMES`].
fn plain(name: &str) -> String {
    name.to_lowercase().replace([' ', '_'], "")
}

/// Gives instruments' columns the names that are known here. Returns these, each with the name in
/// the file.
fn rename(
    table: &mut Table,
    columns: &mut [String],
    notes: &mut Vec<String>,
) -> Vec<(String, String)> {
    let mut renamed = Vec::new();
    let called = |written: &str| Header::of(written).name;
    for (own, name) in NAMES {
        let is_known = |(written, _): &(String, Vec<Entry>)| called(written).to_lowercase() == name;
        let place = table
            .columns
            .iter()
            .position(|(w, _)| plain(&called(w)) == own);
        // The separation of a force curve is the distance and the deflection.
        let is_other = match (own, name) {
            ("separation", _) => is_force_curve(table) && !oscillates(table),
            (_, "deflection") => oscillates(table),
            _ => false,
        };
        let Some(place) = place.filter(|_| !is_other && !table.columns.iter().any(is_known)) else {
            continue;
        };
        let header = Header::of(&table.columns[place].0);
        notes.push(format!(
            "{}: `{}` is taken as {name}",
            table.name, header.name
        ));
        follow(columns, &header.name, name);
        table.columns[place].0 = written(name, &header.unit);
        renamed.push((name.to_owned(), header.name));
    }
    renamed
}

/// Sensitivities by the column that they convert from V, in the file's header, in m/V.
const SENSITIVITIES: [(&str, &str); 2] = [("deflection", "InvOLS"), ("amplitude", "AmpInvOLS")];
/// A property of the lever in the header that differs from the case's by more than this part is
/// reported.
const OTHER_LEVER: f64 = 0.02;

/// Stiffness, resonance and quality factor of the lever in the header, in N/m, Hz and 1.
pub(super) const SPRING_CONSTANT: &str = "SpringConstant";
pub(super) const THERMAL_FREQUENCY: &str = "ThermalFrequency";
pub(super) const THERMAL_QUALITY: &str = "ThermalQ";

/// A positive number in the header of a table's file.
pub(super) fn noted(table: &Table, name: &str) -> Option<f64> {
    let (_, value) = table.notes.iter().find(|(known, _)| known == name)?;
    let value = value.parse::<f64>().ok();
    value.filter(|of| of.is_finite() && *of > 0.0)
}

/// What the header of an instrument's file says: the sensitivity of columns in V, and the lever,
/// where it is another than that of the case.
fn from_header(case: &Case, table: &mut Table, notes: &mut Vec<String>) {
    let stated = |name: &str| noted(table, name);
    let levers = [
        (Key::LeverK, SPRING_CONSTANT, "N/m"),
        (Key::LeverF0, THERMAL_FREQUENCY, "Hz"),
        (Key::LeverQ, THERMAL_QUALITY, ""),
    ];
    for (key, name, unit) in levers {
        let value = case.get(key);
        if let Some(of) = stated(name).filter(|of| (of / value - 1.0).abs() > OTHER_LEVER) {
            let amount = |of: f64| format!("{} {unit}", shortest(of)).trim_end().to_owned();
            notes.push(format!(
                "{}: the header says {name} = {}, the case {} = {}: the case counts",
                table.name,
                amount(of),
                key.path(),
                amount(value)
            ));
        }
    }
    let found: Vec<(usize, f64, &str)> = SENSITIVITIES
        .iter()
        .filter_map(|(column, name)| Some((place_of(table, &[column])?, stated(name)?, *name)))
        .collect();
    for (place, sensitivity, name) in found {
        let header = Header::of(&table.columns[place].0);
        let per_unit = match header.unit.as_str() {
            "V" => 1e9 * sensitivity,
            "mV" => 1e6 * sensitivity,
            _ => continue,
        };
        for entry in &mut table.columns[place].1 {
            if let Entry::Number(x) = entry {
                *x *= per_unit;
            }
        }
        table.columns[place].0 = written(&header.name, "nm");
        notes.push(format!(
            "{}: {} = {per_unit:.5} nm/{} is that of the header ({name}); state another one with the \
             option `convert`",
            table.name, header.name, header.unit
        ));
    }
}

/// The place of a column with one of these names.
fn place_of(table: &Table, names: &[&str]) -> Option<usize> {
    let name = |written: &str| Header::of(written).name.to_lowercase();
    let is = |(written, _): &(String, Vec<Entry>)| names.contains(&name(written).as_str());
    table.columns.iter().position(is)
}

/// Whether a column is a quantity of an oscillation.
fn oscillates(table: &Table) -> bool {
    table.columns.iter().any(|(written, _)| {
        let quantity = Quantity::named(&Header::of(written).name, true);
        quantity.is_some_and(|quantity| quantity.rest().is_none())
    })
}

/// Whether a column is a quantity of a force curve, or an instrument's name of one.
fn is_force_curve(table: &Table) -> bool {
    let names = NAMES.iter().filter(|(_, name)| *name == "deflection");
    let own: Vec<&str> = names
        .map(|(own, _)| *own)
        .chain(["deflection", "force"])
        .collect();
    let mut columns = table.columns.iter();
    columns.any(|(w, _)| own.contains(&plain(&Header::of(w).name).as_str()))
}

/// The numbers of a column; `None` if it has other entries.
fn numbers(table: &Table, place: usize) -> Option<Vec<f64>> {
    let entries = table.columns[place].1.iter();
    entries
        .map(|entry| match entry {
            Entry::Number(x) if x.is_finite() => Some(*x),
            _ => None,
        })
        .collect()
}

/// Leaves out the columns that a force curve does not need, and of an oscillating lever its
/// deflection, if no selection was made; a separation without a distance becomes one.
fn force_curve(
    case: &Case,
    table: &mut Table,
    columns: &[String],
    renamed: &[(String, String)],
    notes: &mut Vec<String>,
) -> Result<(), Error> {
    let remove = |table: &mut Table, names: &[&str]| {
        table.columns.retain(|(written, _)| {
            let header = Header::of(written);
            let name = data::error_of(&header)
                .unwrap_or(&header.name)
                .to_lowercase();
            !names.contains(&name.as_str())
        });
    };
    if columns.is_empty() && oscillates(table) {
        remove(table, &["deflection", "force"]);
        remove(table, &OF_FORCE_CURVE);
        notes.push(format!(
            "{}: the deflection is left out: the columns of the oscillation are fitted",
            table.name
        ));
        return Ok(());
    }
    if place_of(table, &["distance", "zc", "gap", "gap.tip"]).is_none() {
        distance_of_separation(case, table, renamed, notes)?;
    }
    if columns.is_empty() {
        remove(table, &OF_FORCE_CURVE);
        if place_of(table, &["deflection"]).is_some() {
            remove(table, &["force"]);
        }
    }
    Ok(())
}

/// The distance as the separation without the deflection: an instrument computes the separation
/// from both, with the stiffness of the lever if it gives the force alone.
fn distance_of_separation(
    case: &Case,
    table: &mut Table,
    renamed: &[(String, String)],
    notes: &mut Vec<String>,
) -> Result<(), Error> {
    let place = |name: &str| place_of(table, &[name]);
    let (Some(separation), Some(of)) = (
        place("separation"),
        place("deflection").or_else(|| place("force")),
    ) else {
        return Ok(());
    };
    for place in [separation, of] {
        check_volts(table, place, renamed)?;
    }
    let size = |place: usize, kind: Kind| {
        let unit = Header::of(&table.columns[place].0).unit;
        let size = kind.parse(&format!("1 {unit}"));
        size.map_err(|error| {
            Error::input(
                format!("{}: {error}", table.place(None, place)),
                "name it as in `separation (nm)`, `deflection (nm)`, `force (nN)`",
            )
        })
    };
    let is_force = Header::of(&table.columns[of].0)
        .name
        .eq_ignore_ascii_case("force");
    let (by_value, how) = if is_force {
        let stiffness = case.get(Key::LeverK);
        (size(of, Kind::Force)? / stiffness, "force / cantilever.k")
    } else {
        (size(of, Kind::Length)?, "deflection")
    };
    let factor = by_value / size(separation, Kind::Length)?;
    let unit = Header::of(&table.columns[separation].0).unit;
    let values = table.columns[of].1.clone();
    for (entry, value) in table.columns[separation].1.iter_mut().zip(values) {
        *entry = match (&entry, value) {
            (Entry::Number(s), Entry::Number(v)) => Entry::Number(s - factor * v),
            _ => Entry::Missing,
        };
    }
    table.columns[separation].0 = written("distance", &unit);
    notes.push(format!(
        "{}: the distance is taken as separation - {how}",
        table.name
    ));
    Ok(())
}

/// Whether a table as it is written is a force curve, by the names of its columns, of which `columns` are
/// used, or all, and which `conversions` rename: there is a deflection, and nothing of an oscillation.
pub(super) fn is_plain_force_curve(
    table: &Table,
    columns: &[String],
    conversions: &[String],
) -> bool {
    let renames = conversions.iter().filter_map(|text| {
        let Conversion { name, renamed, .. } = Conversion::parse(text).ok()?;
        Some((name, renamed?))
    });
    let renames: Vec<(String, String)> = renames.collect();
    let name = |written: &str| {
        let renamed = renames
            .iter()
            .find(|(own, _)| Header::is_called(written, own));
        plain(&renamed.map_or_else(|| Header::of(written).name, |(_, name)| name.clone()))
    };
    let chosen = table.columns.iter().filter(|(w, _)| is_chosen(w, columns));
    let names: Vec<String> = chosen.map(|(w, _)| name(w)).collect();
    let known = |name: &String| {
        let known = NAMES.iter().find(|(own, _)| own == name);
        let name = known.map_or(name.as_str(), |(_, name)| name);
        Quantity::named(name, true)
    };
    let mut found = names.iter().filter_map(known).peekable();
    found.peek().is_some() && found.all(|quantity| quantity.rest().is_some())
}

/// Direction of the distance of a force curve, and where it turns. Returns whether the distance is
/// counted the other way than in the file.
fn guess_force_curve(
    case: &Case,
    table: &mut Table,
    stated: Stated,
    notes: &mut Vec<String>,
) -> bool {
    let places = (
        place_of(table, &["distance", "zc", "gap"]),
        place_of(table, &["deflection", "force"]),
    );
    let ((Some(place), Some(of)), false) = (places, oscillates(table)) else {
        return false;
    };
    let known = (numbers(table, place), numbers(table, of));
    let (Some(mut distance), Some(values)) = known else {
        return false;
    };
    let places = Places {
        distance: place,
        amplitude: of,
        phase: of,
    };
    if distance.len() < MIN_ROWS || !is_curve(case, table, &places) {
        return false;
    }
    let rises = approach_rises(table, &distance);
    let is_reversed = !stated.direction && rises.unwrap_or_else(|| bends_far(&distance, &values));
    if is_reversed {
        for z in &mut distance {
            *z = -*z;
        }
        table.columns[place].1 = distance.iter().copied().map(Entry::Number).collect();
        notes.push(format!(
            "{}: the distance is counted the other way, so that the lever is free where it is large",
            table.name
        ));
    }
    add_direction(table, &distance, notes);
    is_reversed
}

/// Whether the distance rises while the tip approaches, of a table whose rows are in the order in which
/// they were measured: an approach and then a retract, on which the distance goes the other way.
fn approach_rises(table: &Table, distance: &[f64]) -> Option<bool> {
    let place = place_of(table, &["direction", "way"])?;
    let way = |entry: &Entry| match entry {
        Entry::Text(word) => data::way(word),
        _ => None,
    };
    let ways = table.columns[place].1.iter().map(way);
    let ways: Vec<Way> = ways.collect::<Option<_>>()?;
    let runs: Vec<(Way, usize)> = ways
        .chunk_by(|a, b| a == b)
        .map(|run| (run[0], run.len()))
        .collect();
    let [(Way::Approach, turn), (Way::Retract, rest)] = runs[..] else {
        return None;
    };
    let travel = |from: usize, to: usize| distance[to - 1] - distance[from];
    let [there, back] = [travel(0, turn), travel(turn, turn + rest)];
    (there * back < 0.0).then_some(there > 0.0)
}

/// Whether a force curve leaves the line through its middle farther where the distance is large than where
/// it is small. A tilt of the baseline leaves both ends on that line.
fn bends_far(distance: &[f64], values: &[f64]) -> bool {
    let sorted = by_distance(distance);
    let quarter = sorted.len() / 4;
    let middle = &sorted[quarter..sorted.len() - quarter];
    let [mut z, mut y, mut zz, mut zy] = [0.0; 4];
    for k in middle {
        z += distance[*k] / middle.len() as f64;
        y += values[*k] / middle.len() as f64;
    }
    for k in middle {
        zz += (distance[*k] - z) * (distance[*k] - z);
        zy += (distance[*k] - z) * (values[*k] - y);
    }
    let slope = if zz > 0.0 { zy / zz } else { 0.0 };
    let part = (distance.len() / 12).clamp(3, distance.len() / 4);
    let off = |rows: &[usize]| {
        let off = rows
            .iter()
            .map(|k| values[*k] - y - slope * (distance[*k] - z));
        median(off.collect()).abs()
    };
    off(&sorted[sorted.len() - part..]) > off(&sorted[..part])
}

/// Approach and retract as a column, if there is none and the distance turns.
fn add_direction(table: &mut Table, distance: &[f64], notes: &mut Vec<String>) {
    let has_direction = place_of(table, &["direction", "way"]).is_some();
    if !has_direction && let Some(turn) = turning_point(distance) {
        let direction = |from: usize, to: usize| {
            let falls = distance[to - 1] < distance[from];
            Entry::Text(if falls { "approach" } else { "retract" }.to_owned())
        };
        let (first, second) = (direction(0, turn), direction(turn, distance.len()));
        let column = (0..distance.len()).map(|k| if k < turn { &first } else { &second });
        let column = column.cloned().collect();
        table.columns.push(("direction".to_owned(), column));
        notes.push(format!(
            "{}: approach and retract part at row {turn}",
            table.name
        ));
    }
}

/// The columns of amplitude curves that guesses change.
struct Places {
    distance: usize,
    amplitude: usize,
    phase: usize,
}

fn places(table: &Table) -> Option<Places> {
    Some(Places {
        distance: place_of(table, &["distance", "zc", "gap"])?,
        amplitude: place_of(table, &["amplitude", "first_harmonic", "a"])?,
        phase: place_of(table, &["phase"])?,
    })
}

/// Directions, and of a `foreign` table, whose columns had other names or were converted, the
/// zeros of distance and phase and the sign of the phase, except what was `stated`. Returns whether
/// the zero of the phase is a guess.
fn guess(
    case: &Case,
    table: &mut Table,
    renamed: &[(String, String)],
    foreign: bool,
    stated: Stated,
    remarks: &mut Vec<String>,
) -> Result<bool, Error> {
    let Some(places) = places(table).filter(|places| is_curve(case, table, places)) else {
        return Ok(false);
    };
    let all = [places.distance, places.amplitude, places.phase];
    let all = all.map(|place| numbers(table, place));
    let [Some(mut distance), Some(mut amplitude), Some(mut phase)] = all else {
        return Ok(false);
    };
    if distance.len() < MIN_ROWS {
        return Ok(false);
    }
    let mut guessed_phase = false;
    let mut notes: Vec<String> = Vec::new();
    if !stated.direction && is_reversed(&distance, &amplitude) {
        for z in &mut distance {
            *z = -*z;
        }
        notes.push(
            "the distance is counted the other way, so that the amplitude grows with it".to_owned(),
        );
    }
    let header = Header::of(&table.columns[places.amplitude].0);
    if header.unit == "V" || header.unit == "mV" {
        let length = Header::of(&table.columns[places.distance].0).unit;
        match tapping_line(&distance, &amplitude) {
            Some(line) if line.is_reliable => {
                for a in &mut amplitude {
                    *a /= line.slope;
                }
                table.columns[places.amplitude].0 = written(&header.name, &length);
                notes.push(format!(
                    "the amplitude's sensitivity is taken from the slope in contact, {:.4} {length}/{}: \
                     a few percent wrong, and more on a soft sample; state it with the option `convert`",
                    1.0 / line.slope,
                    header.unit
                ));
            }
            _ => {
                return Err(Error::option(
                    "convert",
                    format!(
                        "{}: the amplitude is in {}, and too little of it falls in contact to tell its \
                         sensitivity",
                        table.place(None, places.amplitude),
                        header.unit
                    ),
                    sensitivity(&header.name, &header.unit, renamed),
                ));
            }
        }
    }
    let lag = free_lag(case);
    let free = free_rows(&distance, &amplitude);
    if foreign
        && !stated.phase
        && let Some(own) = free.phase(&phase)
        && let Some(lag) = lag
        && wrapped(own - lag).abs() > OWN_PHASE
    {
        guessed_phase = true;
        let deep = deep_deviation(&amplitude, free.amplitude, &phase, own);
        let sign = if deep > 0.0 { -1.0 } else { 1.0 };
        for value in &mut phase {
            *value = lag + sign * wrapped(*value - own);
        }
        let counted = if sign > 0.0 { "from" } else { "backwards from" };
        notes.push(format!(
            "the phase is counted {counted} its value far from the sample, {own:.1}°, where the lever lags by \
             {lag:.1}°: near the sample it falls, as over a repulsive sample; state it with the option `convert` if the \
             sample only attracts"
        ));
    }
    if foreign
        && !stated.zero
        && let Some(line) = tapping_line(&distance, &amplitude)
    {
        let offset = free.amplitude - line.knee(free.amplitude);
        if offset.abs() > 2.0 * free.amplitude {
            for z in &mut distance {
                *z += offset;
            }
            let unit = Header::of(&table.columns[places.distance].0).unit;
            notes.push(format!(
                "the distance is counted from where the amplitude begins to fall: {offset:.5} {unit} was \
                 added, which is good to a nanometre or two"
            ));
        }
    }
    for (place, values) in [
        (places.distance, &distance),
        (places.amplitude, &amplitude),
        (places.phase, &phase),
    ] {
        table.columns[place].1 = values.iter().copied().map(Entry::Number).collect();
    }
    let place = |note: String| format!("{}: {note}", table.name);
    remarks.extend(notes.into_iter().map(place));
    add_direction(table, &distance, remarks);
    Ok(guessed_phase)
}

/// Whether the rows are one curve over the distance: it varies, no other key does, and no column
/// tells several curves or kinds of motion apart.
fn is_curve(case: &Case, table: &Table, places: &Places) -> bool {
    let mut columns = table.columns.iter().enumerate();
    let varies = |place: usize| {
        let entries = &table.columns[place].1;
        entries.iter().any(|entry| Some(entry) != entries.first())
    };
    varies(places.distance)
        && columns.all(|(place, (written, _))| {
            let header = Header::of(written);
            let name = header.name.to_lowercase();
            place == places.distance
                || !matches!(name.as_str(), "curve" | "classification")
                    && (!data::is_position(&header, case) || !varies(place))
        })
}

/// The lever's free phase in degrees.
pub(super) fn free_lag(case: &Case) -> Option<f64> {
    let cantilever = case.cantilever()?;
    let response = free_response(cantilever).ok()?;
    Some(-response.argument().to_degrees())
}

/// Whether the amplitude is larger where the distance is smaller.
fn is_reversed(distance: &[f64], amplitude: &[f64]) -> bool {
    let sorted = by_distance(distance);
    let end = (distance.len() / 12).max(5).min(distance.len() / 2);
    let level = |rows: &[usize]| median(rows.iter().map(|k| amplitude[*k]).collect());
    level(&sorted[..end]) > level(&sorted[sorted.len() - end..])
}

/// Returns the indices of the rows, sorted by increasing distance.
fn by_distance(distance: &[f64]) -> Vec<usize> {
    let mut sorted: Vec<usize> = (0..distance.len()).collect();
    sorted.sort_by(|a, b| distance[*a].total_cmp(&distance[*b]));
    sorted
}

/// The farthest rows, whose amplitude is free.
struct Free {
    amplitude: f64,
    rows: Vec<usize>,
    /// The rows after them that may be free.
    doubtful: Vec<usize>,
}

impl Free {
    /// Median phase of the free rows in degrees.
    fn phase(&self, phase: &[f64]) -> Option<f64> {
        let reference = phase[*self.rows.first()?];
        let turns = self.rows.iter().map(|k| wrapped(phase[*k] - reference));
        Some(reference + median(turns.collect()))
    }
}

fn free_rows(distance: &[f64], amplitude: &[f64]) -> Free {
    let mut sorted = by_distance(distance);
    sorted.reverse();
    let end = (sorted.len() / 20).max(3);
    let level = median(sorted[..end].iter().map(|k| amplitude[*k]).collect());
    let leaves = |k: &usize| (amplitude[*k] / level - 1.0).abs() > 0.02;
    let free = sorted.iter().position(leaves).unwrap_or(sorted.len());
    sorted.truncate(free.max(3));
    // The last ones may feel the sample already.
    let doubtful = sorted.split_off((free * 4 / 5).max(3));
    Free {
        amplitude: level,
        rows: sorted,
        doubtful,
    }
}

/// The farthest rows, whose amplitude is free, the farthest first.
pub(super) fn far_rows(distance: &[f64], amplitude: &[f64]) -> Vec<usize> {
    far_and_doubtful_rows(distance, amplitude)[0].clone()
}

/// The same, and the rows after them that may be free.
pub(super) fn far_and_doubtful_rows(distance: &[f64], amplitude: &[f64]) -> [Vec<usize>; 2] {
    if amplitude.len() < MIN_ROWS || amplitude.iter().any(|a| !a.is_finite()) {
        return [Vec::new(), Vec::new()];
    }
    let free = free_rows(distance, amplitude);
    [free.rows, free.doubtful]
}

/// How far the phase of deep rows lies from the free phase `own`, in degrees.
fn deep_deviation(amplitude: &[f64], free: f64, phase: &[f64], own: f64) -> f64 {
    let in_range = |low: f64, high: f64| -> Vec<f64> {
        let rows = amplitude.iter().zip(phase);
        let deep = rows.filter(|(a, _)| (low..high).contains(*a));
        deep.map(|(_, phase)| wrapped(phase - own)).collect()
    };
    let deep = in_range(0.2 * free, 0.8 * free);
    if deep.len() >= 8 {
        return median(deep);
    }
    let least = amplitude.iter().copied().fold(f64::INFINITY, f64::min);
    let rest = in_range(0.0, 0.5 * (free + least));
    if rest.is_empty() { 0.0 } else { median(rest) }
}

/// The line of the amplitude against the distance while tapping.
pub(super) struct Line {
    slope: f64,
    offset: f64,
    is_reliable: bool,
}

impl Line {
    /// Where the line reaches the free amplitude.
    pub(super) fn knee(&self, free: f64) -> f64 {
        (free - self.offset) / self.slope
    }
}

/// A robust line through the rows between 0.35 and 0.85 of the free amplitude.
pub(super) fn tapping_line(distance: &[f64], amplitude: &[f64]) -> Option<Line> {
    let free = free_rows(distance, amplitude).amplitude;
    let rows: Vec<(f64, f64)> = distance
        .iter()
        .zip(amplitude)
        .filter(|(_, a)| (0.35 * free..0.85 * free).contains(*a))
        .map(|(z, a)| (*z, *a))
        .collect();
    if rows.len() < 4 {
        return None;
    }
    let centre = median(rows.iter().map(|(z, _)| *z).collect());
    let mut weights = vec![1.0; rows.len()];
    let (mut slope, mut level) = (0.0, 0.0);
    for _ in 0..6 {
        let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            let both = rows.iter().zip(&weights);
            both.map(|((z, a), weight)| weight * of(z - centre, *a))
                .sum()
        };
        let (n, x, y) = (sum(&|_, _| 1.0), sum(&|z, _| z), sum(&|_, a| a));
        let (xx, xy) = (sum(&|z, _| z * z), sum(&|z, a| z * a));
        slope = (n * xy - x * y) / (n * xx - x * x);
        level = (y - slope * x) / n;
        let residuals: Vec<f64> = rows
            .iter()
            .map(|(z, a)| (a - level - slope * (z - centre)).abs())
            .collect();
        let scale = 1.5 * 1.4826 * median(residuals.clone());
        weights = residuals
            .iter()
            .map(|residual| 1.0 / residual.max(scale).max(1e-9 * free))
            .collect();
    }
    let least = amplitude.iter().copied().fold(f64::INFINITY, f64::min);
    (slope > 0.0 && slope.is_finite()).then_some(Line {
        slope,
        offset: level - slope * centre,
        is_reliable: rows.len() >= 8 && least < 0.65 * free,
    })
}

/// The first row after the turning point of a distance that goes to the sample and back.
fn turning_point(distance: &[f64]) -> Option<usize> {
    let count = distance.len();
    let ends = 0.5 * (distance[0] + distance[count - 1]);
    let near = |k: usize| {
        let window = &distance[k.saturating_sub(2)..(k + 3).min(count)];
        (window.iter().sum::<f64>() / window.len() as f64 - ends).abs()
    };
    // The first of equally far rows.
    let turn = (0..count).min_by(|a, b| near(*b).total_cmp(&near(*a)))?;
    let inside = turn * 10 >= count && turn * 10 <= 9 * count;
    inside.then_some(turn + 1)
}

/// The middle of some values.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[middle],
        _ => 0.5 * (values[middle - 1] + values[middle]),
    }
}

/// An angle in degrees in [−180, 180).
pub fn wrapped(degrees: f64) -> f64 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A deflection over the distance: contact in the nearest twelfth, and a tilted baseline.
    fn tilted(distance: f64) -> f64 {
        0.3 * distance + (8.0 - distance).max(0.0)
    }

    #[test]
    fn a_tilted_baseline_does_not_hide_where_contact_is() {
        let rising: Vec<f64> = (0..100).map(f64::from).collect();
        let values: Vec<f64> = rising.iter().map(|z| tilted(*z)).collect();
        assert!(!bends_far(&rising, &values));
        let falling: Vec<f64> = rising.iter().map(|z| -z).collect();
        assert!(bends_far(&falling, &values));
    }

    #[test]
    fn approach_and_retract_tell_which_way_the_distance_counts() {
        let there: Vec<f64> = (0..50).map(|k| 50.0 - f64::from(k)).collect();
        let both: Vec<f64> = there.iter().chain(there.iter().rev()).copied().collect();
        let words = |first: &str, second: &str| Table {
            columns: vec![(
                "direction".to_owned(),
                (0..100)
                    .map(|k| Entry::Text(if k < 50 { first } else { second }.to_owned()))
                    .collect(),
            )],
            ..Table::default()
        };
        let measured = words("approach", "retract");
        assert_eq!(approach_rises(&measured, &both), Some(false));
        let turned: Vec<f64> = both.iter().map(|z| -z).collect();
        assert_eq!(approach_rises(&measured, &turned), Some(true));
        // Rows that are sorted by distance do not tell.
        let sorted: Vec<f64> = there.iter().chain(&there).copied().collect();
        assert_eq!(approach_rises(&measured, &sorted), None);
        assert_eq!(approach_rises(&words("retract", "approach"), &both), None);
    }

    #[test]
    fn rules_are_linear_or_a_factor_with_units_or_a_name() {
        for (rule, factor, offset) in [
            ("90-x", -1.0, 90.0),
            ("-x", -1.0, 0.0),
            ("x + 3", 1.0, 3.0),
            ("1.5*x-2e1", 1.5, -20.0),
            ("x/4", 0.25, 0.0),
            ("x*1e-3+1", 1e-3, 1.0),
        ] {
            assert_eq!(linear(rule), Some((factor, offset)), "{rule}");
        }
        for rule in [
            "x+x", "3", "x-", "x^2", "2x", "", "--x", "x/0", "nm/V", "0*x",
        ] {
            assert_eq!(linear(rule), None, "{rule}");
        }
        let amplitude = Conversion::parse("Amp=58 nm/V").unwrap();
        assert_eq!(amplitude.factor, 58.0);
        assert_eq!(amplitude.units, Some(["V".to_owned(), "nm".to_owned()]));
        let named = Conversion::parse("Ch3=amplitude").unwrap();
        assert_eq!(named.renamed.as_deref(), Some("amplitude"));
        for wrong in ["Amp", "=x", "Amp=", "Amp=58 nm", "Amp=?"] {
            assert!(Conversion::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_header_converts_volts_and_names_another_lever() {
        let words = [
            "cantilever.k=2 N/m",
            "cantilever.f0=70 kHz",
            "cantilever.Q=120",
            "sample.stiffness=8 N/m",
            "drive.frequency=70 kHz",
            "drive.free_amplitude=20 nm",
            "gap.tip=10 nm",
        ];
        let case = Case::parse(None, &words.map(str::to_owned)).unwrap();
        let column = |name: &str, value: f64| (name.to_owned(), vec![Entry::Number(value)]);
        let note = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        let table = Table {
            name: "curve.ibw".to_owned(),
            columns: vec![
                column("ZSnsr (nm)", 1.0),
                column("Amp (V)", 0.5),
                column("Phase (deg)", 90.0),
            ],
            notes: vec![
                note("AmpInvOLS", "5.8e-08"),
                note("SpringConstant", "42"),
                note("ThermalQ", "121"),
            ],
            ..Table::default()
        };
        let found = prepared(&case, std::slice::from_ref(&table), &[], &[]).unwrap();
        let (header, values) = &found.tables[0].columns[1];
        assert_eq!(header, "amplitude (nm)");
        // 0.5 V at 58 nm/V.
        assert!(matches!(values[0], Entry::Number(x) if (x - 29.0).abs() < 1e-12));
        let says = |text: &str| found.notes.iter().any(|note| note.contains(text));
        assert!(says("AmpInvOLS") && says("SpringConstant = 42 N/m") && !says("ThermalQ"));
        // What is stated counts.
        let stated = ["Amp=60 nm/V".to_owned()];
        let found = prepared(&case, &[table], &stated, &[]).unwrap();
        let (_, values) = &found.tables[0].columns[1];
        assert!(matches!(values[0], Entry::Number(x) if (x - 30.0).abs() < 1e-12));
    }
}
