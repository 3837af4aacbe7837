//! Measured curves: tables whose columns are quantities of the case and observables.
//!
//! A column is named by a key of the case (`gap.tip (nm)`, `drive.frequency (kHz)`, `alpha5`),
//! whose value its rows set, or by an observable, with either of its names (`phase`, `E_dis (eV)`).
//! Experimenters' names are accepted: `distance` and `zc` are the gap between tip and sample,
//! `frequency` is that of the drive, and `amplitude` is what a lock-in amplifier reads, unless the
//! table has another column for that (then it is half of peak to peak, as elsewhere). `NAME error
//! (unit)` contains standard errors, `direction` the direction of the abscissa, `curve` the curve
//! to which a row belongs.
//!
//! A table written by `approach` is read without changes. It has most observables twice, in the
//! model's units and in SI. Of a physical case the columns in SI count, and only amplitude and
//! phase unless others are named; of a curve under frequency modulation, its shift and the drive
//! ratio. Rows of motions in neither direction do not belong to either curve; they are left out and
//! counted.

use nanotap_case::near_name::near_name;
use nanotap_case::physical::Kind;
use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_motions::approach::Way;
use nanotap_observe::OBSERVABLES;

use super::quantity::Quantity;
use super::statistics::span;
use super::terms::Ramp;
use super::thin::Scatter;
use nanotap_case::table::{Entry, Header, Table};

/// All curves, and the meaning of their columns.
#[derive(Clone, Debug)]
pub struct Data {
    /// The measured curves, in the order of the data.
    pub curves: Vec<Curve>,
    /// The measured quantities, each once.
    pub columns: Vec<Column>,
    /// The keys that rows set, first the one that varies along the curves.
    pub swept: Vec<SweptKey>,
    /// Number of rows that belong to neither direction and are left out.
    pub left_out: usize,
}

/// A column of measured values: quantity, unit and scatter.
#[derive(Clone, Debug)]
pub struct Column {
    /// Quantity that the column contains: an observable, or a reading of a loop or a force curve.
    pub quantity: Quantity,
    /// Name of the column in the data.
    pub name: String,
    /// Unit in the data; empty if there is none.
    pub unit: String,
    /// Factor from the unit of the data to SI, or to the model's unit for a dimensionless case.
    pub factor: f64,
    /// Standard deviation of the values, in SI or the model's units: the scale of residuals without
    /// a model.
    pub spread: f64,
    /// Scatter of the values about smooth curves, where it is known.
    pub(crate) scatter: Option<Scatter>,
}

/// A key that rows set.
#[derive(Clone, Debug)]
pub struct SweptKey {
    /// Key of the case that the rows set.
    pub key: Key,
    /// Name of the column in the data.
    pub name: String,
    /// Unit in the data; empty if there is none.
    pub unit: String,
    /// Factor from the unit of the data to that of the key.
    pub factor: f64,
}

/// Rows that were measured in sequence.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name of the curve, from the `curve` column or the table; unique among the curves.
    pub name: String,
    /// The rows, in order of measurement.
    pub rows: Vec<Row>,
}

/// The values measured at one position.
#[derive(Clone, Debug)]
pub struct Row {
    /// Values of the swept keys, in the units of the keys.
    pub at: Vec<f64>,
    /// The measured values, one per column, in SI or the model's units; phases in degrees.
    pub values: Vec<Option<f64>>,
    /// Standard errors of the values, one per column, in the units of `values`; None where none is
    /// given.
    pub errors: Vec<Option<f64>>,
    /// Standard errors of the values relative to those of a single row, which are estimated where
    /// none are given.
    pub relative: Vec<f64>,
    /// Direction of the abscissa, if given.
    pub way: Option<Way>,
    /// Line in the file, or number of the row from 1.
    pub line: u64,
    /// How many rows it is the average of.
    pub(crate) count: usize,
    /// Whether it is far from the sample, where the scatter of the values is known.
    pub(crate) is_free: bool,
    /// Where it is on the ramp of its curve.
    pub(crate) ramp: Ramp,
}

impl Data {
    /// Returns the number of measured values of all rows and columns, without missing ones.
    pub fn count(&self) -> usize {
        self.rows().flat_map(|row| &row.values).flatten().count()
    }

    /// True if the data were measured under frequency modulation.
    pub fn is_modulated(&self) -> bool {
        self.columns
            .iter()
            .any(|column| column.quantity.modulated().is_some())
    }

    /// True if the data are force curves: the lever is at rest at every row.
    pub fn is_force_curve(&self) -> bool {
        self.columns
            .iter()
            .any(|column| column.quantity.rest().is_some())
    }

    /// Returns the rows of all curves, curve by curve.
    pub fn rows(&self) -> impl Iterator<Item = &Row> {
        self.curves.iter().flat_map(|curve| &curve.rows)
    }

    /// Keeps the rows for which `keeps` is true, given the name of their curve, and the curves that have
    /// such rows.
    pub(super) fn retain(&mut self, keeps: impl Fn(&str, &Row) -> bool) {
        for curve in &mut self.curves {
            curve.rows.retain(|row| keeps(&curve.name, row));
        }
        self.curves.retain(|curve| !curve.rows.is_empty());
    }

    /// Reads the data in `tables`; `only` names the columns to use, all if it is empty.
    ///
    /// # Errors
    /// If a column or an entry is invalid, with its position.
    pub fn read(case: &Case, tables: &[Table], only: &[String]) -> Result<Self, Error> {
        let mut data = Self {
            curves: Vec::new(),
            columns: Vec::new(),
            swept: Vec::new(),
            left_out: 0,
        };
        for table in tables {
            data.add(case, table, only)?;
        }
        let files: Vec<&str> = tables.iter().map(|table| table.name.as_str()).collect();
        let files = files.join(", ");
        if data.columns.is_empty() {
            return Err(Error::option(
                "data",
                format!("{files}: no column is a measured quantity"),
                "name them as in `distance (nm)`, `amplitude (nm)`, `phase (deg)`, or with \
                 {convert} NAME=amplitude",
            ));
        }
        if data.swept.is_empty() {
            return Err(Error::option(
                "data",
                format!("{files}: no column gives the positions of the measured values"),
                "give `distance (nm)` or another key of the case such as `drive.frequency (kHz)`, or \
                 say which column it is with {convert} NAME=distance",
            ));
        }
        if data.rows().next().is_none() {
            return Err(Error::option(
                "data",
                format!("{files}: no rows"),
                "give rows with the position and the measured values",
            ));
        }
        let observed = data
            .columns
            .iter()
            .find(|c| c.quantity.observable().is_some());
        if let (true, Some(observed)) = (data.is_modulated(), observed) {
            return Err(Error::option(
                "data",
                format!(
                    "`{}` cannot be combined with a curve under frequency modulation, which holds amplitude \
                     and phase",
                    observed.name
                ),
                "select {columns}: frequency_shift, drive_ratio",
            ));
        }
        data.finish();
        if data.is_force_curve() {
            data.check_force_curve(case)?;
        }
        Ok(data)
    }

    fn check_force_curve(&self, case: &Case) -> Result<(), Error> {
        nanotap_scan::force_curve::physical(case)?;
        let other = self.columns.iter().find(|c| c.quantity.rest().is_none());
        if let Some(other) = other {
            return Err(Error::option(
                "data",
                format!(
                    "`{}` cannot be combined with a force curve, whose lever is at rest",
                    other.name
                ),
                "select {columns}: deflection, or those of the oscillation",
            ));
        }
        let further = self.swept.iter().find(|swept| !is_distance(swept.key));
        if let Some(further) = further {
            return Err(Error::option(
                "data",
                format!(
                    "`{}`: the rows of a force curve differ in their distance alone",
                    further.name
                ),
                "leave the column out with {columns}, and state it in the case",
            ));
        }
        Ok(())
    }

    fn add(&mut self, case: &Case, table: &Table, only: &[String]) -> Result<(), Error> {
        let headers: Vec<Header> = table.columns.iter().map(|(h, _)| Header::of(h)).collect();
        let chosen = |header: &Header, written: &str| {
            only.is_empty()
                || label(header).is_some()
                || only.iter().any(|name| {
                    name == written || *name == header.name || error_of(header) == Some(name)
                })
        };
        for name in only {
            let known = |(header, (written, _)): (&Header, &(String, Vec<Entry>))| {
                name == written || *name == header.name
            };
            if !headers.iter().zip(&table.columns).any(known) {
                let names: Vec<&str> = headers.iter().map(|h| h.name.as_str()).collect();
                return Err(Error::option(
                    "columns",
                    format!("{} has no column `{name}`", table.name),
                    format!("it has {}", names.join(", ")),
                ));
            }
        }
        let own_amplitude = headers.iter().any(|header| {
            Quantity::named(&header.name, true).is_some_and(|q| q.name() == "first_harmonic")
        });
        let mut roles: Vec<Role> = Vec::new();
        for (index, header) in headers.iter().enumerate() {
            let counts = if of_approach(&headers) {
                counts_of_approach(&headers, index, case, only)
            } else {
                chosen(header, &table.columns[index].0)
            };
            let role = if counts {
                role(header, case, own_amplitude)
                    .map_err(|error| error.context(table.place(None, index)))?
            } else {
                Role::Nothing
            };
            if let Some(before) = roles.iter().position(|known| known.is_same(&role)) {
                return Err(Error::input(
                    format!(
                        "{}: column {} `{}` is the same quantity",
                        table.place(None, index),
                        before + 1,
                        table.columns[before].0
                    ),
                    "select columns with {columns}",
                ));
            }
            roles.push(role);
        }
        // Index of each column among the columns of all tables.
        let places: Vec<usize> = roles
            .iter()
            .zip(&headers)
            .map(|(role, header)| self.place_of(role, header))
            .collect();
        for (role, index) in roles.iter().zip(0..) {
            if let Role::Error(quantity, _) = role
                && !self.columns.iter().any(|c| c.quantity == *quantity)
            {
                return Err(Error::input(
                    format!("{}: its values are missing", table.place(None, index)),
                    format!("give the column `{}` too", quantity.name()),
                ));
            }
        }
        let mut rows: Vec<(String, Row)> = Vec::new();
        for row in 0..table.rows() {
            let (curve, row) = self.row(table, &roles, &places, row)?;
            if row.way == Some(Way::Neither) {
                self.left_out += 1;
            } else {
                rows.push((curve, row));
            }
        }
        for (curve, row) in rows {
            match self.curves.iter_mut().find(|known| known.name == curve) {
                Some(known) => known.rows.push(row),
                None => self.curves.push(Curve {
                    name: curve,
                    rows: vec![row],
                }),
            }
        }
        Ok(())
    }

    fn place_of(&mut self, role: &Role, header: &Header) -> usize {
        match role {
            Role::Set(key, factor) => {
                let known = self.swept.iter().position(|swept| swept.key == *key);
                known.unwrap_or_else(|| {
                    self.swept.push(SweptKey {
                        key: *key,
                        name: header.name.clone(),
                        unit: header.unit.clone(),
                        factor: *factor,
                    });
                    self.swept.len() - 1
                })
            }
            Role::Measured(quantity, factor) => {
                let known = self.columns.iter().position(|c| c.quantity == *quantity);
                known.unwrap_or_else(|| {
                    self.columns.push(Column {
                        quantity: *quantity,
                        name: header.name.clone(),
                        unit: header.unit.clone(),
                        factor: *factor,
                        spread: 0.0,
                        scatter: None,
                    });
                    self.columns.len() - 1
                })
            }
            _ => 0,
        }
    }

    fn row(
        &self,
        table: &Table,
        roles: &[Role],
        places: &[usize],
        index: usize,
    ) -> Result<(String, Row), Error> {
        let mut row = Row {
            at: vec![f64::NAN; self.swept.len()],
            values: vec![None; self.columns.len()],
            errors: vec![None; self.columns.len()],
            relative: vec![1.0; self.columns.len()],
            way: None,
            line: table.lines.get(index).copied().unwrap_or(index as u64 + 1),
            count: 1,
            is_free: false,
            ramp: Ramp::default(),
        };
        let mut curve = table.name.clone();
        for (column, role) in roles.iter().enumerate() {
            let entry = table.columns[column].1.get(index);
            let entry = entry.unwrap_or(&Entry::Missing);
            let refuse = |what: String, remedy: &str| {
                let place = table.place(Some(index), column);
                Err(Error::input(format!("{place}: {what}"), remedy))
            };
            let number = match (role, entry) {
                (Role::Nothing, _) | (_, Entry::Missing) => None,
                (Role::Way, Entry::Text(word)) => {
                    row.way = way(word);
                    if row.way.is_none() {
                        return refuse(format!("`{word}` is not a direction"), DIRECTIONS);
                    }
                    None
                }
                (Role::Curve, Entry::Text(name)) => {
                    curve.clone_from(name);
                    None
                }
                (Role::Curve, Entry::Number(number)) => {
                    curve = number.to_string();
                    None
                }
                (Role::Way, Entry::Number(number)) => {
                    return refuse(format!("{number} is not a direction"), DIRECTIONS);
                }
                (_, Entry::Text(text)) => {
                    return refuse(
                        format!("`{text}` is not a number"),
                        "write all numbers with a decimal point, or all with a decimal comma and \
                         semicolons between the columns; leave missing values empty",
                    );
                }
                (_, Entry::Number(number)) if !number.is_finite() => {
                    return refuse(format!("{number} is not finite"), "leave it empty");
                }
                (_, Entry::Number(number)) => Some(*number),
            };
            let Some(number) = number else { continue };
            match role {
                Role::Set(_, factor) => row.at[places[column]] = number * factor,
                Role::Measured(_, factor) => row.values[places[column]] = Some(number * factor),
                Role::Error(quantity, factor) => {
                    if number <= 0.0 {
                        return refuse(
                            format!("{number} is not a standard error"),
                            "it must be above zero; leave it empty if it is unknown",
                        );
                    }
                    let at = self.columns.iter().position(|c| c.quantity == *quantity);
                    row.errors[at.unwrap_or(0)] = Some(number * factor);
                }
                Role::Nothing | Role::Way | Role::Curve => {}
            }
        }
        if let Some(missing) = row.at.iter().position(|at| at.is_nan()) {
            let key = self.swept[missing].key;
            let is = |role: &Role| matches!(role, Role::Set(known, _) if *known == key);
            let column = roles.iter().position(is);
            return Err(Error::input(
                match column {
                    Some(column) => {
                        let place = table.place(Some(index), column);
                        format!("{place}: the position of the row is missing")
                    }
                    None => format!("{} does not give {key}, as the other tables do", table.name),
                },
                "give it in every row of every table",
            ));
        }
        Ok((curve, row))
    }

    /// Sorts rows by time of measurement, and determines the swept key and the spread of columns.
    fn finish(&mut self) {
        for (index, column) in self.columns.iter_mut().enumerate() {
            let rows = self.curves.iter().flat_map(|curve| &curve.rows);
            let values: Vec<f64> = rows.filter_map(|row| *row.values.get(index)?).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let squares = values.iter().map(|value| (value - mean).powi(2));
            column.spread = (squares.sum::<f64>() / values.len() as f64).sqrt();
            if column.quantity.rest().is_some() {
                // Of a long ramp few rows are in contact: as if the values were uniform in their range.
                let [least, most] = span(values.iter().copied());
                column.spread = column.spread.max((most - least) / 12f64.sqrt());
            }
        }
        let count = self.columns.len();
        let distinct = |index: usize| {
            let most = self.curves.iter().map(|curve| {
                let mut values: Vec<u64> =
                    curve.rows.iter().map(|r| r.at[index].to_bits()).collect();
                values.sort_unstable();
                values.dedup();
                values.len()
            });
            most.max().unwrap_or(0)
        };
        let mut order: Vec<usize> = (0..self.swept.len()).collect();
        order.sort_by_key(|index| std::cmp::Reverse(distinct(*index)));
        self.swept = order.iter().map(|k| self.swept[*k].clone()).collect();
        let to_distance = self.swept.first().is_some_and(|s| is_distance(s.key));
        for curve in &mut self.curves {
            for row in &mut curve.rows {
                row.at = order.iter().map(|k| row.at[*k]).collect();
                // Rows of tables that were read before one with a further column.
                row.values.resize(count, None);
                row.errors.resize(count, None);
                row.relative.resize(count, 1.0);
            }
            if curve.rows.iter().all(|row| row.way.is_some()) {
                // Approach goes to smaller distances, a sweep upwards to larger values.
                curve.rows.sort_by(|a, b| {
                    let first = |row: &Row| row.way == Some(Way::Retract);
                    let up = first(a) == to_distance;
                    let along = a.at[0].total_cmp(&b.at[0]);
                    let along = if up { along } else { along.reverse() };
                    first(a).cmp(&first(b)).then(along)
                });
            }
        }
    }
}

/// True if a key is the distance between tip and sample.
pub fn is_distance(key: Key) -> bool {
    matches!(key, Key::GapTip | Key::Alpha5 | Key::OscillatorGap)
}

const DIRECTIONS: &str = "write approach or retract; for other sweeps, up or down";

/// Parses a direction: an upward sweep comes first, as an approach does.
pub(super) fn way(word: &str) -> Option<Way> {
    match word.to_lowercase().as_str() {
        "approach" | "extend" | "trace" | "up" => Some(Way::Approach),
        "retract" | "retrace" | "down" => Some(Way::Retract),
        "neither" => Some(Way::Neither),
        _ => None,
    }
}

/// True if a table was written by `approach`.
pub(super) fn of_approach(headers: &[Header]) -> bool {
    let names: Vec<&str> = headers.iter().map(|h| h.name.as_str()).take(5).collect();
    matches!(
        names[..],
        ["way", _, "classification", "period", "spectral_radius"]
    )
}

/// True if a column of such a table is used: see the module's documentation.
fn counts_of_approach(headers: &[Header], index: usize, case: &Case, only: &[String]) -> bool {
    let header = &headers[index];
    let physical = case.is_physical();
    let has_zc = headers.iter().any(|h| h.name == "zc");
    match header.name.as_str() {
        "way" => return true,
        "zc" => return physical,
        _ if index == 1 => return !(physical && has_zc),
        _ => {}
    }
    let Some(quantity) = Quantity::named(&header.name, true) else {
        return false;
    };
    let modulated = headers.iter().any(|h| h.name == "frequency_shift");
    let wanted = if only.is_empty() && modulated {
        matches!(quantity.name(), "frequency_shift" | "drive_ratio")
    } else if only.is_empty() {
        matches!(quantity.name(), "first_harmonic" | "phase")
    } else {
        let named = |name: &String| {
            let name = Header::of(name).name;
            name == header.name || name == quantity.name() || name == quantity.si_name()
        };
        only.iter().any(named)
    };
    let same = |other: &&Header| Quantity::named(&other.name, true) == Some(quantity);
    let mut all = headers.iter().filter(same);
    let in_si = all.clone().find(|other| physical && !other.unit.is_empty());
    let first = in_si.or_else(|| all.next());
    wanted && first.is_some_and(|first| std::ptr::eq(first, header))
}

/// Meaning of a column, with the size of its unit.
#[derive(Clone, Copy, Debug)]
enum Role {
    Set(Key, f64),
    Measured(Quantity, f64),
    Error(Quantity, f64),
    Way,
    Curve,
    Nothing,
}

impl Role {
    fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Set(a, _), Self::Set(b, _)) => a == b || is_distance(*a) && is_distance(*b),
            (Self::Measured(a, _), Self::Measured(b, _))
            | (Self::Error(a, _), Self::Error(b, _)) => a == b,
            (Self::Way, Self::Way) | (Self::Curve, Self::Curve) => true,
            _ => false,
        }
    }
}

/// The quantity whose standard errors the column contains.
pub(super) fn error_of(header: &Header) -> Option<&str> {
    let start = header.name.len().checked_sub(" error".len())?;
    let (of, end) = header.name.split_at_checked(start)?;
    end.eq_ignore_ascii_case(" error").then(|| of.trim())
}

/// The role of a column that tells rows apart.
fn label(header: &Header) -> Option<Role> {
    match header.name.to_lowercase().as_str() {
        "direction" | "way" => Some(Role::Way),
        "curve" => Some(Role::Curve),
        _ => None,
    }
}

/// Whether the column is understood: a label, a quantity or a key of the case.
pub(super) fn is_known(header: &Header, case: &Case) -> bool {
    let name = error_of(header).unwrap_or(&header.name);
    label(header).is_some() || Quantity::named(name, true).is_some() || set(name, case).is_ok()
}

/// Whether the column sets the position of its rows.
pub(super) fn is_position(header: &Header, case: &Case) -> bool {
    label(header).is_none()
        && Quantity::named(&header.name, true).is_none()
        && set(&header.name, case).is_ok()
}

/// Whether its values are lengths.
pub(super) fn is_length(header: &Header, case: &Case) -> bool {
    let kind = match Quantity::named(&header.name, true) {
        Some(quantity) => quantity.kind(),
        None => set(&header.name, case).ok().map(Key::kind),
    };
    case.is_physical() && kind == Some(Kind::Length)
}

fn role(header: &Header, case: &Case, own_amplitude: bool) -> Result<Role, Error> {
    if let Some(label) = label(header) {
        return Ok(label);
    }
    if let Some(of) = error_of(header) {
        let column = Header {
            name: of.to_owned(),
            unit: header.unit.clone(),
        };
        return match role(&column, case, own_amplitude)? {
            Role::Measured(quantity, factor) => Ok(Role::Error(quantity, factor)),
            _ => Err(Error::input(
                format!("`{of}` is set, not measured, and has no standard error"),
                "omit the column",
            )),
        };
    }
    if let Some(quantity) = Quantity::named(&header.name, own_amplitude) {
        return Ok(Role::Measured(quantity, unit_of(header, quantity, case)?));
    }
    let key = set(&header.name, case)?;
    Ok(Role::Set(key, unit_of_key(header, key, case)?))
}

fn unit_of(header: &Header, quantity: Quantity, case: &Case) -> Result<f64, Error> {
    let kind = quantity.kind().filter(|_| case.is_physical());
    match (quantity.is_angle(), kind, header.unit.as_str()) {
        (true, _, "" | "deg" | "°" | "degree" | "degrees") | (_, None, "" | "1") => Ok(1.0),
        (true, _, "rad") => Ok(1f64.to_degrees()),
        (_, Some(kind), "") => Err(without_unit(header, kind)),
        (_, Some(kind), unit) => kind
            .parse(&format!("1 {unit}"))
            .map_err(|error| Error::input(error.to_string(), "change the unit in brackets")),
        (_, None, unit) => Err(Error::input(
            format!("`{unit}` is not a unit of this quantity"),
            if case.is_physical() {
                "it has no unit: omit the brackets"
            } else {
                "a dimensionless case has its own units: omit the brackets, or give a \
                 case in physical quantities"
            },
        )),
    }
}

fn without_unit(header: &Header, kind: Kind) -> Error {
    let unit = match kind {
        Kind::Length => "nm",
        kind => kind.si_unit(),
    };
    Error::input(
        format!("it has no unit, and {} needs one", kind.noun()),
        format!("name it as in `{} ({unit})`", header.name),
    )
}

fn unit_of_key(header: &Header, key: Key, case: &Case) -> Result<f64, Error> {
    let unit = match (header.unit.as_str(), key.kind()) {
        ("", kind) if !case.is_physical() || kind == Kind::Number => "",
        ("", Kind::Length) => return Err(without_unit(header, Kind::Length)),
        ("", kind) => kind.si_unit(),
        (unit, _) => unit,
    };
    let text = format!("1 {unit}");
    case.value(key, text.trim())
        .map_err(|error| Error::from(error).remedy("name it as in `distance (nm)`"))
}

/// The key of the case that a name means.
pub(super) fn set(name: &str, case: &Case) -> Result<Key, Error> {
    let plain = name.to_lowercase().replace([' ', '-'], "_");
    let physical = case.is_physical();
    match plain.as_str() {
        "distance" | "zc" | "gap" if physical => return Ok(Key::GapTip),
        "distance" | "zc" | "gap" => return Ok(case.gap_key()),
        "frequency" if physical => return Ok(Key::DriveFrequency),
        "frequency" if case.oscillator().is_some() => return Ok(Key::OscillatorOmega),
        "frequency" => return Ok(Key::Omega),
        _ => {}
    }
    case.key(name).map_err(|error| {
        let words = [
            "distance",
            "frequency",
            "amplitude",
            "deflection",
            "force",
            "direction",
            "curve",
        ];
        let observables = OBSERVABLES.iter().filter(|o| o.is_number);
        let names = words.into_iter().chain(observables.map(|o| o.name));
        let names: Vec<&str> = names.collect();
        let near = near_name(name, names.iter().copied());
        if name.contains('.') {
            return error.into();
        }
        let others = "or select the others with {columns}";
        Error::input(
            format!("`{name}` is neither an observable nor a key of the case"),
            match near {
                Some(near) => format!("did you mean {{convert}} \"{name}={near}\"? {others}"),
                None => format!("say what it is, as in {{convert}} \"{name}=distance\", {others}"),
            },
        )
    })
}
