//! The module in two parts: what the page needs first, and what it loads on demand.
//!
//! A function of the second part stays in the first as a stub of the same index. The stub has the second part
//! loaded, if it is not there, and calls the function through the table. The second part imports memory,
//! table, variables and the functions that it calls from the first, and fills its own entries of the table.
//! Everything else stays as it was compiled, so that both parts together are the one module.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::convert::Infallible;

use wasm_encoder::reencode::{Error, Reencode, utils};
use wasm_encoder::{
    BlockType, CodeSection, ConstExpr, ElementSection, Elements, EntityType, ExportKind,
    ExportSection, Function, FunctionSection, GlobalSection, GlobalType, ImportSection,
    Instruction, MemoryType, Module, RefType, TableType, TypeSection, ValType,
};
use wasmparser::{
    ElementItems, ExternalKind, FunctionBody, KnownCustom, Name, Operator, Parser, Payload, TypeRef,
};

use crate::exact::ModuleError;

/// The function that has the second part loaded.
const LOAD: &str = "load";
/// Under this name the second part imports what the first exports.
const FIRST: &str = "first";
/// The name of the memory among these; functions and variables have their indices in their names.
const MEMORY: &str = "memory";
/// The name of the table.
const TABLE: &str = "table";

/// A module in one part and in two, without the names of its functions.
pub(crate) struct Parts {
    /// The module in one part.
    pub(crate) whole: Vec<u8>,
    /// What is loaded first.
    pub(crate) first: Vec<u8>,
    /// What is loaded on demand.
    pub(crate) second: Vec<u8>,
}

/// Splits a module: late are the functions for whose names `late` holds, and those that only they call.
///
/// # Errors
/// If it is no module that the compiler makes.
pub(crate) fn split(module: &[u8], late: impl Fn(&str) -> bool) -> Result<Parts, ModuleError> {
    let outline = Outline::read(module)?;
    let Late { functions, called } = outline.late(late)?;
    // The names have done their duty.
    let whole = encoded(&mut Nameless, module)?;
    let mut first = First {
        outline: &outline,
        slots: functions
            .iter()
            .copied()
            .zip(outline.table.initial as u32..)
            .collect(),
        called: &called,
        body: outline.imported,
    };
    let mut second = Second {
        outline: &outline,
        late: &functions,
        called: &called,
        indices: called.iter().chain(&functions).copied().zip(0..).collect(),
    };
    Ok(Parts {
        first: encoded(&mut first, &whole)?,
        second: second.written(&whole)?,
        whole,
    })
}

/// A module written again.
fn encoded(
    encoder: &mut impl Reencode<Error = Infallible>,
    module: &[u8],
) -> Result<Vec<u8>, ModuleError> {
    let mut out = Module::new();
    utils::parse_core_module(encoder, &mut out, Parser::new(0), module)?;
    Ok(out.finish())
}

/// Leaves the names out.
struct Nameless;

impl Reencode for Nameless {
    type Error = Infallible;

    fn parse_custom_section(
        &mut self,
        _: &mut Module,
        _: wasmparser::CustomSectionReader<'_>,
    ) -> Result<(), Error<Infallible>> {
        Ok(())
    }
}

/// What there is in a module.
struct Outline<'a> {
    /// Number of imported functions, which have the first indices.
    imported: u32,
    /// Number of parameters of each type.
    parameters: Vec<u32>,
    /// Type of each function.
    types: Vec<u32>,
    bodies: Vec<FunctionBody<'a>>,
    names: HashMap<u32, &'a str>,
    /// Functions that are called from outside or through the table.
    known: HashSet<u32>,
    /// The function that has the second part loaded.
    load: u32,
    memory: wasmparser::MemoryType,
    table: wasmparser::TableType,
    globals: Vec<wasmparser::GlobalType>,
}

impl<'a> Outline<'a> {
    fn read(module: &'a [u8]) -> Result<Self, ModuleError> {
        let (mut imported, mut parameters, mut types) = (0, Vec::new(), Vec::new());
        let (mut bodies, mut names, mut known) = (Vec::new(), HashMap::new(), HashSet::new());
        let (mut load, mut memory, mut table, mut globals) = (None, None, None, Vec::new());
        for payload in Parser::new(0).parse_all(module) {
            match payload? {
                Payload::TypeSection(section) => {
                    for ty in section.into_iter_err_on_gc_types() {
                        parameters.push(ty?.params().len() as u32);
                    }
                }
                Payload::ImportSection(section) => {
                    for import in section {
                        if let TypeRef::Func(ty) = import?.ty {
                            types.push(ty);
                            imported += 1;
                        }
                    }
                }
                Payload::FunctionSection(section) => {
                    for ty in section {
                        types.push(ty?);
                    }
                }
                Payload::TableSection(section) => {
                    for one in section {
                        table = Some(one?.ty);
                    }
                }
                Payload::MemorySection(section) => {
                    for one in section {
                        memory = Some(one?);
                    }
                }
                Payload::GlobalSection(section) => {
                    for global in section {
                        globals.push(global?.ty);
                    }
                }
                Payload::ExportSection(section) => {
                    for export in section {
                        let export = export?;
                        if export.kind == ExternalKind::Func {
                            known.insert(export.index);
                            if export.name == LOAD {
                                load = Some(export.index);
                            }
                        }
                    }
                }
                Payload::ElementSection(section) => {
                    for element in section {
                        if let ElementItems::Functions(functions) = element?.items {
                            for function in functions {
                                known.insert(function?);
                            }
                        }
                    }
                }
                Payload::CodeSectionEntry(body) => bodies.push(body),
                Payload::CustomSection(section) => {
                    if let KnownCustom::Name(section) = section.as_known() {
                        for part in section {
                            if let Name::Function(map) = part? {
                                for naming in map {
                                    let naming = naming?;
                                    names.insert(naming.index, naming.name);
                                }
                            }
                        }
                    }
                }
                _ => {}
            }
        }
        Ok(Self {
            imported,
            parameters,
            types,
            bodies,
            names,
            known,
            load: load.ok_or(ModuleError::Missing(LOAD))?,
            memory: memory.ok_or(ModuleError::Missing(MEMORY))?,
            table: table.ok_or(ModuleError::Missing(TABLE))?,
            globals,
        })
    }

    fn body(&self, function: u32) -> &FunctionBody<'a> {
        &self.bodies[(function - self.imported) as usize]
    }

    /// The functions of the second part.
    fn late(&self, named: impl Fn(&str) -> bool) -> Result<Late, ModuleError> {
        let own = self.imported..self.types.len() as u32;
        let mut late: HashSet<u32> = own
            .clone()
            .filter(|one| self.names.get(one).is_some_and(|name| named(name)))
            .collect();
        let mut callers: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for function in own {
            for operator in self.body(function).get_operators_reader()? {
                if let Operator::Call { function_index } = operator? {
                    callers.entry(function_index).or_default().push(function);
                }
            }
        }
        // What only late functions call is late, too.
        loop {
            let before = late.len();
            for (function, of) in &callers {
                let own = *function >= self.imported && !self.known.contains(function);
                if own && of.iter().all(|caller| late.contains(caller)) {
                    late.insert(*function);
                }
            }
            if late.len() == before {
                break;
            }
        }
        late.remove(&self.load);
        let calls = |(function, of): (&u32, &Vec<u32>)| {
            let is_called = of.iter().any(|caller| late.contains(caller));
            (is_called && !late.contains(function)).then_some(*function)
        };
        let called = callers.iter().filter_map(calls).collect();
        let mut functions: Vec<u32> = late.into_iter().collect();
        functions.sort_unstable();
        Ok(Late { functions, called })
    }
}

/// The functions of the second part, and those of the first that they call, in ascending order.
struct Late {
    functions: Vec<u32>,
    called: Vec<u32>,
}

/// Under this name the first part exports a function, and the second imports it.
fn function_name(index: u32) -> String {
    format!("f{index}")
}

/// Under this name the first part exports a variable, and the second imports it.
fn global_name(index: usize) -> String {
    format!("g{index}")
}

/// The first part: the module with stubs.
struct First<'a> {
    outline: &'a Outline<'a>,
    /// The entry of the table of each function that is late.
    slots: HashMap<u32, u32>,
    /// The functions that the second part calls.
    called: &'a [u32],
    /// The function whose body comes next.
    body: u32,
}

impl First<'_> {
    /// The variable that says whether the second part is there.
    fn is_loaded(&self) -> u32 {
        self.outline.globals.len() as u32
    }
}

impl Reencode for First<'_> {
    type Error = Infallible;

    fn table_type(&mut self, ty: wasmparser::TableType) -> Result<TableType, Error<Infallible>> {
        let room = self.slots.len() as u64;
        let mut ty = utils::table_type(self, ty)?;
        ty.minimum += room;
        ty.maximum = ty.maximum.map(|most| most + room);
        Ok(ty)
    }

    fn parse_global_section(
        &mut self,
        globals: &mut GlobalSection,
        section: wasmparser::GlobalSectionReader<'_>,
    ) -> Result<(), Error<Infallible>> {
        utils::parse_global_section(self, globals, section)?;
        let is_loaded = GlobalType {
            val_type: ValType::I32,
            mutable: true,
            shared: false,
        };
        globals.global(is_loaded, &ConstExpr::i32_const(0));
        Ok(())
    }

    fn parse_export_section(
        &mut self,
        exports: &mut ExportSection,
        section: wasmparser::ExportSectionReader<'_>,
    ) -> Result<(), Error<Infallible>> {
        utils::parse_export_section(self, exports, section)?;
        exports.export(TABLE, ExportKind::Table, 0);
        for function in self.called {
            exports.export(&function_name(*function), ExportKind::Func, *function);
        }
        for index in 0..self.outline.globals.len() {
            exports.export(&global_name(index), ExportKind::Global, index as u32);
        }
        Ok(())
    }

    fn parse_function_body(
        &mut self,
        code: &mut CodeSection,
        body: FunctionBody<'_>,
    ) -> Result<(), Error<Infallible>> {
        let function = self.body;
        self.body += 1;
        let Some(slot) = self.slots.get(&function) else {
            return utils::parse_function_body(self, code, body);
        };
        let ty = self.outline.types[function as usize];
        let mut stub = Function::new([]);
        stub.instruction(&Instruction::GlobalGet(self.is_loaded()))
            .instruction(&Instruction::I32Eqz)
            .instruction(&Instruction::If(BlockType::Empty))
            .instruction(&Instruction::Call(self.outline.load))
            .instruction(&Instruction::I32Const(1))
            .instruction(&Instruction::GlobalSet(self.is_loaded()))
            .instruction(&Instruction::End);
        for parameter in 0..self.outline.parameters[ty as usize] {
            stub.instruction(&Instruction::LocalGet(parameter));
        }
        stub.instruction(&Instruction::I32Const(*slot as i32))
            .instruction(&Instruction::CallIndirect {
                type_index: ty,
                table_index: 0,
            })
            .instruction(&Instruction::End);
        code.function(&stub);
        Ok(())
    }
}

/// The second part: the late functions.
struct Second<'a> {
    outline: &'a Outline<'a>,
    late: &'a [u32],
    /// The functions of the first part that it calls.
    called: &'a [u32],
    /// The index in the second part of a function of the module.
    indices: HashMap<u32, u32>,
}

impl Second<'_> {
    fn written(&mut self, module: &[u8]) -> Result<Vec<u8>, ModuleError> {
        let mut out = Module::new();
        let mut types = TypeSection::new();
        for payload in Parser::new(0).parse_all(module) {
            if let Payload::TypeSection(section) = payload? {
                self.parse_type_section(&mut types, section)?;
            }
        }
        let mut functions = FunctionSection::new();
        for function in self.late {
            functions.function(self.outline.types[*function as usize]);
        }
        let mut elements = ElementSection::new();
        let entries: Vec<u32> = self.late.iter().map(|one| self.indices[one]).collect();
        let place = ConstExpr::i32_const(self.outline.table.initial as i32);
        elements.active(None, &place, Elements::Functions(entries.into()));
        let mut code = CodeSection::new();
        for function in self.late {
            let body = self.outline.body(*function).clone();
            self.parse_function_body(&mut code, body)?;
        }
        let imports = self.imports()?;
        out.section(&types).section(&imports).section(&functions);
        out.section(&elements).section(&code);
        Ok(out.finish())
    }

    fn imports(&mut self) -> Result<ImportSection, ModuleError> {
        let mut imports = ImportSection::new();
        for function in self.called {
            let ty = EntityType::Function(self.outline.types[*function as usize]);
            imports.import(FIRST, &function_name(*function), ty);
        }
        let memory = MemoryType {
            minimum: self.outline.memory.initial,
            maximum: self.outline.memory.maximum,
            memory64: false,
            shared: false,
            page_size_log2: None,
        };
        imports.import(FIRST, MEMORY, EntityType::Memory(memory));
        let table = TableType {
            element_type: RefType::FUNCREF,
            minimum: self.outline.table.initial + self.late.len() as u64,
            maximum: None,
            table64: false,
            shared: false,
        };
        imports.import(FIRST, TABLE, EntityType::Table(table));
        for (index, ty) in self.outline.globals.iter().enumerate() {
            let ty = utils::global_type(self, *ty)?;
            imports.import(FIRST, &global_name(index), EntityType::Global(ty));
        }
        Ok(imports)
    }
}

impl Reencode for Second<'_> {
    type Error = Infallible;

    fn function_index(&mut self, function: u32) -> Result<u32, Error<Infallible>> {
        Ok(self.indices[&function])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_encoder::{MemorySection, NameMap, NameSection, TableSection};

    /// The instruction before the end of each function of a part.
    fn bodies(part: &[u8]) -> Vec<Vec<String>> {
        let payloads = Parser::new(0).parse_all(part).map(Result::unwrap);
        let bodies = payloads.filter_map(|payload| match payload {
            Payload::CodeSectionEntry(body) => Some(body),
            _ => None,
        });
        let operators = |body: FunctionBody<'_>| {
            let all = body.get_operators_reader().unwrap().into_iter();
            all.map(|one| format!("{:?}", one.unwrap())).collect()
        };
        bodies.map(operators).collect()
    }

    /// Functions of one number: `load`, `early`, which calls `late` and `shared`, `late`, which calls `own`
    /// and `shared`, and these two.
    fn module() -> Vec<u8> {
        let mut types = TypeSection::new();
        types.ty().function([], []);
        types.ty().function([ValType::F64], [ValType::F64]);
        let (mut functions, mut code, mut names) =
            (FunctionSection::new(), CodeSection::new(), NameMap::new());
        let calls: [(&str, u32, &[u32]); 5] = [
            ("load", 0, &[]),
            ("early", 1, &[2, 4]),
            ("late", 1, &[3, 4]),
            ("own", 1, &[]),
            ("shared", 1, &[]),
        ];
        for (index, (name, ty, called)) in (0..).zip(calls) {
            functions.function(ty);
            names.append(index, name);
            let mut function = Function::new([]);
            if ty == 1 {
                function.instruction(&Instruction::LocalGet(0));
            }
            for other in called {
                function.instruction(&Instruction::Call(*other));
            }
            code.function(function.instruction(&Instruction::End));
        }
        let mut tables = TableSection::new();
        tables.table(TableType {
            element_type: RefType::FUNCREF,
            minimum: 1,
            maximum: Some(1),
            table64: false,
            shared: false,
        });
        let mut memories = MemorySection::new();
        memories.memory(MemoryType {
            minimum: 1,
            maximum: None,
            memory64: false,
            shared: false,
            page_size_log2: None,
        });
        let mut globals = GlobalSection::new();
        let stack = GlobalType {
            val_type: ValType::I32,
            mutable: true,
            shared: false,
        };
        globals.global(stack, &ConstExpr::i32_const(65_536));
        let mut exports = ExportSection::new();
        exports.export(MEMORY, ExportKind::Memory, 0);
        exports.export(LOAD, ExportKind::Func, 0);
        exports.export("early", ExportKind::Func, 1);
        let mut section = NameSection::new();
        section.functions(&names);
        let mut module = Module::new();
        module.section(&types).section(&functions).section(&tables);
        module
            .section(&memories)
            .section(&globals)
            .section(&exports);
        module.section(&code).section(&section);
        module.finish()
    }

    #[test]
    fn late_functions_and_what_only_they_call_become_stubs() {
        let parts = split(&module(), |name| name == "late").unwrap();
        let [first, second] = [&parts.first, &parts.second].map(|part| bodies(part));
        let calls = |body: &[String]| -> Vec<String> {
            let calls = body.iter().filter(|one| one.starts_with("Call"));
            calls.cloned().collect()
        };
        let call = |index: u32| {
            format!(
                "{:?}",
                Operator::Call {
                    function_index: index
                }
            )
        };
        let through = |type_index| Operator::CallIndirect {
            type_index,
            table_index: 0,
        };
        assert_eq!(calls(&first[1]), [call(2), call(4)]);
        for (stub, slot) in [(2, 1), (3, 2)] {
            assert_eq!(calls(&first[stub]), [call(0), format!("{:?}", through(1))]);
            let entry = format!("{:?}", Operator::I32Const { value: slot });
            assert!(first[stub].contains(&entry));
        }
        // The second part imports `shared`, which comes before its own two.
        assert_eq!(second.len(), 2);
        assert_eq!(calls(&second[0]), [call(2), call(0)]);
    }

    #[test]
    fn a_module_in_one_part_keeps_all_but_the_names() {
        let whole = split(&module(), |_| false).unwrap().whole;
        assert_eq!(bodies(&whole), bodies(&module()));
        assert!(whole.len() < module().len());
    }

    #[test]
    fn a_module_that_cannot_load_is_refused() {
        let empty = Module::new().finish();
        assert!(matches!(
            split(&empty, |_| true),
            Err(ModuleError::Missing(LOAD))
        ));
    }
}
