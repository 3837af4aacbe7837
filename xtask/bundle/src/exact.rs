//! Modules that give the same numbers on every machine.
//!
//! A relaxed instruction may give one of several results. Those for least and greatest values, lanes and
//! whole numbers are replaced by the exact ones of which the compiler made them. `relaxed_madd` is fused
//! where the processor has such an instruction, and rounds twice elsewhere: one module keeps it, and in the
//! other, which needs no relaxed instruction, each is a call of the module's own function, which computes
//! the fused result from exact products and sums. The code is so compiled once.

use std::convert::Infallible;

use wasm_encoder::reencode::{Error, Reencode, utils};
use wasm_encoder::{Instruction, Module};
use wasmparser::{ExternalKind, Operator, Parser, Payload};

/// The functions that replace `relaxed_madd` and `relaxed_nmadd`.
const FUSED: [&str; 2] = ["nanotap_fused", "nanotap_fused_negative"];

/// Why a module was not written again.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ModuleError {
    /// It is not a module.
    #[error("not a WebAssembly module: {0}")]
    Invalid(#[from] wasmparser::BinaryReaderError),
    /// It has no function of this name.
    #[error("the module exports no function `{0}`")]
    Missing(&'static str),
    /// It has a relaxed instruction for which there is no exact one here.
    #[error("the module has the relaxed instruction {0}")]
    Relaxed(String),
    /// It could not be written.
    #[error("the module cannot be written again: {0}")]
    Encoding(#[from] Error<Infallible>),
}

/// What becomes of relaxed multiply-adds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MultiplyAdd {
    /// They stay, for machines that fuse them.
    Kept,
    /// They are calls of functions.
    Called,
}

/// The module without relaxed instructions, but for multiply-adds that are kept.
pub(crate) fn rewritten(module: &[u8], multiply_add: MultiplyAdd) -> Result<Vec<u8>, ModuleError> {
    let mut replacement = Replacement {
        functions: functions(module)?,
        multiply_add,
        other: None,
    };
    let mut out = Module::new();
    utils::parse_core_module(&mut replacement, &mut out, Parser::new(0), module)?;
    match replacement.other {
        Some(other) => Err(ModuleError::Relaxed(other)),
        None => Ok(out.finish()),
    }
}

/// The indices of the functions that compute fused results.
fn functions(module: &[u8]) -> Result<[u32; 2], ModuleError> {
    let mut found = [None; 2];
    for payload in Parser::new(0).parse_all(module) {
        if let Payload::ExportSection(exports) = payload? {
            for export in exports {
                let export = export?;
                let place = FUSED.iter().position(|name| *name == export.name);
                if let (Some(place), ExternalKind::Func) = (place, export.kind) {
                    found[place] = Some(export.index);
                }
            }
        }
    }
    let of = |k: usize| found[k].ok_or(ModuleError::Missing(FUSED[k]));
    Ok([of(0)?, of(1)?])
}

struct Replacement {
    functions: [u32; 2],
    multiply_add: MultiplyAdd,
    /// A relaxed instruction for which there is no exact one.
    other: Option<String>,
}

impl Reencode for Replacement {
    type Error = Infallible;

    fn instruction<'a>(
        &mut self,
        operator: Operator<'a>,
    ) -> Result<Instruction<'a>, Error<Infallible>> {
        let called = self.multiply_add == MultiplyAdd::Called;
        Ok(match operator {
            Operator::F64x2RelaxedMadd if called => Instruction::Call(self.functions[0]),
            Operator::F64x2RelaxedNmadd if called => Instruction::Call(self.functions[1]),
            // The compiler makes them of comparisons and selections.
            Operator::F64x2RelaxedMin => Instruction::F64x2PMin,
            Operator::F64x2RelaxedMax => Instruction::F64x2PMax,
            Operator::F32x4RelaxedMin => Instruction::F32x4PMin,
            Operator::F32x4RelaxedMax => Instruction::F32x4PMax,
            Operator::I8x16RelaxedLaneselect
            | Operator::I16x8RelaxedLaneselect
            | Operator::I32x4RelaxedLaneselect
            | Operator::I64x2RelaxedLaneselect => Instruction::V128Bitselect,
            Operator::I8x16RelaxedSwizzle => Instruction::I8x16Swizzle,
            Operator::I32x4RelaxedTruncF32x4S => Instruction::I32x4TruncSatF32x4S,
            Operator::I32x4RelaxedTruncF32x4U => Instruction::I32x4TruncSatF32x4U,
            Operator::I32x4RelaxedTruncF64x2SZero => Instruction::I32x4TruncSatF64x2SZero,
            Operator::I32x4RelaxedTruncF64x2UZero => Instruction::I32x4TruncSatF64x2UZero,
            other @ (Operator::F32x4RelaxedMadd
            | Operator::F32x4RelaxedNmadd
            | Operator::I16x8RelaxedQ15mulrS
            | Operator::I16x8RelaxedDotI8x16I7x16S
            | Operator::I32x4RelaxedDotI8x16I7x16AddS) => {
                self.other = Some(format!("{other:?}"));
                utils::instruction(self, other)?
            }
            other => utils::instruction(self, other)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_encoder::{
        CodeSection, ExportKind, ExportSection, Function, FunctionSection, TypeSection, ValType,
    };

    /// A module with one function that returns an operation of its three arguments, and the two others,
    /// which return their first and their third argument.
    fn module(operation: &Instruction<'_>) -> Vec<u8> {
        let mut types = TypeSection::new();
        types.ty().function([ValType::V128; 3], [ValType::V128]);
        let mut functions = FunctionSection::new();
        let mut exports = ExportSection::new();
        let mut code = CodeSection::new();
        let get = Instruction::LocalGet;
        let bodies: [(&str, &[Instruction<'_>]); 3] = [
            ("f", &[get(0), get(1), get(2), operation.clone()]),
            (FUSED[0], &[get(0)]),
            (FUSED[1], &[get(2)]),
        ];
        for (index, (name, body)) in (0..).zip(bodies) {
            functions.function(0);
            exports.export(name, ExportKind::Func, index);
            let mut function = Function::new([]);
            for instruction in body {
                function.instruction(instruction);
            }
            function.instruction(&Instruction::End);
            code.function(&function);
        }
        let mut module = Module::new();
        module.section(&types).section(&functions);
        module.section(&exports).section(&code);
        module.finish()
    }

    #[test]
    fn relaxed_operations_become_calls_and_nothing_else_changes() {
        for (operation, called) in [
            (Instruction::F64x2RelaxedMadd, 1),
            (Instruction::F64x2RelaxedNmadd, 2),
        ] {
            let own = module(&operation);
            let expected = module(&Instruction::Call(called));
            assert_eq!(rewritten(&own, MultiplyAdd::Called).unwrap(), expected);
            assert_eq!(rewritten(&own, MultiplyAdd::Kept).unwrap(), own);
        }
    }

    #[test]
    fn no_other_relaxed_operation_is_left() {
        for how in [MultiplyAdd::Kept, MultiplyAdd::Called] {
            for (relaxed, exact) in [
                (Instruction::F64x2RelaxedMax, Instruction::F64x2PMax),
                (Instruction::F64x2RelaxedMin, Instruction::F64x2PMin),
                (
                    Instruction::I64x2RelaxedLaneselect,
                    Instruction::V128Bitselect,
                ),
            ] {
                let written = rewritten(&module(&relaxed), how).unwrap();
                assert_eq!(written, module(&exact));
            }
            let refused = rewritten(&module(&Instruction::F32x4RelaxedMadd), how);
            assert!(matches!(refused, Err(ModuleError::Relaxed(_))));
        }
    }

    #[test]
    fn a_module_without_the_functions_is_refused() {
        let empty = Module::new().finish();
        let refused = rewritten(&empty, MultiplyAdd::Called)
            .unwrap_err()
            .to_string();
        assert_eq!(refused, "the module exports no function `nanotap_fused`");
        assert!(matches!(
            rewritten(b"no module", MultiplyAdd::Called),
            Err(ModuleError::Invalid(_))
        ));
    }
}
