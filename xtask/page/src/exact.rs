//! A module that gives the same numbers on every machine.
//!
//! `relaxed_madd` is fused where the processor has such an instruction, and rounds twice elsewhere. Here
//! each one is replaced by a call of the module's own function, which computes the fused result from exact
//! products and sums. The code is so compiled once, and both modules agree in everything else.

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
    /// It could not be written.
    #[error("the module cannot be written again: {0}")]
    Encoding(#[from] Error<Infallible>),
}

/// The module with calls in place of relaxed multiply-adds.
pub(crate) fn rewritten(module: &[u8]) -> Result<Vec<u8>, ModuleError> {
    let mut replacement = Replacement {
        functions: functions(module)?,
    };
    let mut out = Module::new();
    utils::parse_core_module(&mut replacement, &mut out, Parser::new(0), module)?;
    Ok(out.finish())
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
}

impl Reencode for Replacement {
    type Error = Infallible;

    fn instruction<'a>(
        &mut self,
        operator: Operator<'a>,
    ) -> Result<Instruction<'a>, Error<Infallible>> {
        Ok(match operator {
            Operator::F64x2RelaxedMadd => Instruction::Call(self.functions[0]),
            Operator::F64x2RelaxedNmadd => Instruction::Call(self.functions[1]),
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
            let expected = module(&Instruction::Call(called));
            assert_eq!(rewritten(&module(&operation)).unwrap(), expected);
        }
    }

    #[test]
    fn a_module_without_the_functions_is_refused() {
        let empty = Module::new().finish();
        let refused = rewritten(&empty).unwrap_err().to_string();
        assert_eq!(refused, "the module exports no function `nanotap_fused`");
        assert!(matches!(
            rewritten(b"no module"),
            Err(ModuleError::Invalid(_))
        ));
    }
}
