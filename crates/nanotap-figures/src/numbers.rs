//! Numbers from JSON, which has neither NaN nor infinity: both are written as `null`.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Numbers with gaps: `null` is NaN.
pub(crate) fn gaps<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    let values = Vec::<Option<f64>>::deserialize(from)?;
    Ok(values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
}

/// Intervals `[start, end]`: `null` is an infinite end.
pub(crate) fn intervals<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<(f64, f64)>, D::Error> {
    let all = Vec::<(Option<f64>, Option<f64>)>::deserialize(from)?;
    let ends = |(from, to): (Option<f64>, Option<f64>)| {
        (
            from.unwrap_or(f64::NEG_INFINITY),
            to.unwrap_or(f64::INFINITY),
        )
    };
    Ok(all.into_iter().map(ends).collect())
}

/// Points as two columns, `{"x": […], "y": […]}`, with gaps.
pub(crate) mod points {
    use super::{Deserialize, Deserializer, Error, Serialize, Serializer, gaps};

    #[derive(Serialize, Deserialize)]
    struct Columns {
        #[serde(deserialize_with = "gaps")]
        x: Vec<f64>,
        #[serde(deserialize_with = "gaps")]
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
