//! Numbers in JSON, which has neither NaN nor infinity: both are `null`.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Numbers with gaps: NaN is `null`.
pub(crate) mod gaps {
    use super::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(values: &[f64], to: S) -> Result<S::Ok, S::Error> {
        values.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
        let values = Vec::<Option<f64>>::deserialize(from)?;
        Ok(values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
    }
}

/// Points as two columns, `{"x": […], "y": […]}`, with `null` for missing numbers.
pub(crate) mod points {
    use serde::de::Error;

    use super::{Deserialize, Deserializer, Serialize, Serializer, gaps};

    #[derive(Serialize, Deserialize)]
    struct Columns {
        #[serde(with = "gaps")]
        x: Vec<f64>,
        #[serde(with = "gaps")]
        y: Vec<f64>,
    }

    pub(crate) fn serialize<S: Serializer>(
        points: &[(f64, f64)],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        let (x, y) = points.iter().copied().unzip();
        Columns { x, y }.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Vec<(f64, f64)>, D::Error> {
        let Columns { x, y } = Columns::deserialize(from)?;
        if x.len() == y.len() {
            Ok(x.into_iter().zip(y).collect())
        } else {
            Err(D::Error::invalid_length(y.len(), &"as many y as x"))
        }
    }
}

/// Intervals `[start, end]`, with `null` for an infinite end.
pub(crate) mod intervals {
    use super::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(all: &[(f64, f64)], to: S) -> Result<S::Ok, S::Error> {
        all.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Vec<(f64, f64)>, D::Error> {
        let all = Vec::<(Option<f64>, Option<f64>)>::deserialize(from)?;
        Ok(all
            .into_iter()
            .map(|(from, to)| {
                (
                    from.unwrap_or(f64::NEG_INFINITY),
                    to.unwrap_or(f64::INFINITY),
                )
            })
            .collect())
    }
}
