"""Compiler of the laws, which the decorator `compiled` uses in place of numba's own dispatcher.

A law that only other laws call is translated to LLVM's intermediate code, and no more. A law that Python calls becomes
an executable: machine code of this law with all the laws that it calls. A separate law is an executable of its own,
which its callers call, so that an edit of it does not compile them again. Numba itself makes machine code and a
wrapper for Python of each function, and optimises it again in each of its callers. Because Python calls only ten of
500 laws, this would double the time of compilation.

Each symbol in the machine code contains the key of its law (law_key), or the name of a separate law. Nothing that is
loaded can therefore be taken for something else, whatever was loaded before.
"""
import contextlib
import copy
import functools
import gc
import importlib
import inspect
import pathlib
import sys
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, TypeAlias

import llvmlite.binding
import llvmlite.ir
from numba.core import compiler, sigutils, types, typing
from numba.core.base import BaseContext
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.datamodel.models import OpaqueModel
from numba.core.environment import Environment
from numba.core.funcdesc import PythonFunctionDescriptor, default_mangler
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.extending import lower_builtin, register_model, type_callable

from pedestal_common import law_cache, law_key

Linkage = llvmlite.binding.Linkage
Types: TypeAlias = tuple[types.Type, ...]       # of the arguments of a law


class _Translation(JITCodeLibrary):
    """LLVM code of one Law for arguments of the types `args`, not yet linked with the laws that it calls."""
    _shared_module: llvmlite.binding.ModuleRef | None       # with the laws that it calls

    def __init__(self, codegen: JITCPUCodegen, law: 'Law', args: Types) -> None:
        super().__init__(codegen, law.py_func.__qualname__)
        self.law, self.args = law, args

    @property
    def calls(self) -> list['_Translation']:
        return [library for library in self._linking_libraries if isinstance(library, _Translation)]

    @property
    def parts(self) -> tuple[list['_Translation'], list['_Translation']]:
        """(this translation with those that it calls, directly or not; those of separate laws that these call)."""
        inside: list[_Translation] = [self]
        separate: list[_Translation] = []
        for part in inside:      # the list grows in the loop
            for called in part.calls:
                among = separate if called.law.separate else inside
                if called not in among:
                    among.append(called)
        return inside, separate

    @property
    def code(self) -> llvmlite.binding.ModuleRef:
        """LLVM module of this law, without the laws that it calls."""
        return self._final_module

    def add_llvm_module(self, ll_module: llvmlite.binding.ModuleRef) -> None:
        """Add an LLVM module without numba's optimisation: the whole executable is optimised later."""
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        """Complete the code of this law with the functions of numba's libraries that it calls.

        Numba numbers its own functions in the order of their use, so two processes give different functions the same
        symbol. They are therefore internal to this module: the linker would else take that of another translation for
        them.
        """
        own = {function.name for function in self._final_module.functions if not function.is_declaration}
        for library in self._linking_libraries:
            if not isinstance(library, _Translation) and library is not rtsys.library:
                self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        for function in self._final_module.functions:
            if not function.is_declaration and function.name not in own:
                function.linkage = 'internal'
        _relink(self._final_module, Linkage.external, 'weak_odr')
        self._finalize_dynamic_globals()
        self._finalized = True

    def _get_module_for_linking(self) -> llvmlite.binding.ModuleRef:
        """Return one LLVM module of this law with all the laws that it calls, except separate laws."""
        if self._shared_module is None:
            modules = [part.code.clone() for part in self.parts[0]]
            modules.append(rtsys.library._get_module_for_linking().clone())
            while len(modules) > 1:     # linked in pairs, because the time of a link grows with the size of both
                for one, other in zip(modules[::2], modules[1::2]):
                    one.link_in(other)
                modules = modules[::2]
            self._shared_module = modules[0]
            _relink(self._shared_module, Linkage.weak_odr, 'linkonce_odr')
            if self.law.separate:
                name = self.law.translation(self.args).fndesc.llvm_func_name
                self._shared_module.get_function(name).linkage = 'external'
        return self._shared_module


def _relink(module: llvmlite.binding.ModuleRef, before: llvmlite.binding.Linkage, after: str) -> None:
    """Give another linkage to functions. With weak_odr the linker keeps one of several equal functions; with
    linkonce_odr it also drops a function that has been inlined everywhere."""
    for function in module.functions:
        if not function.is_declaration and function.linkage == before:
            function.linkage = after


class _Arguments(tuple[types.Type, ...]):
    """Types of arguments with a short text: numba makes a text of them in each of its passes, and that of a record
    with hundreds of fields takes longer than the rest."""

    def __str__(self) -> str:
        return f'{len(self)} arguments'


class _Compiler(compiler.Compiler):
    """Numba's compiler, which gives a law the same symbol in every process, so that a process can use the translation
    that another has cached. Numba's own symbols number laws and types of records in the order of their use."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)
        self.state.targetctx = self.state.targetctx.subtarget(mangler=_symbol)

    def _compile_bytecode(self) -> compiler.CompileResult:
        identity, library = self.state.func_id, self.state.library
        identity.unique_id = int(library.law.symbol(library.args)[:12], 16)
        identity.unique_name = f'{identity.func_qualname}${identity.unique_id}'
        self.state.args = _Arguments(self.state.args)
        return super()._compile_bytecode()


def _symbol(name: str, types: Types, *, abi_tags: tuple[str, ...] = (), uid: int | None = None) -> str:
    """Return the symbol of a law. uid: number that stands for its key and for the types of its arguments."""
    return default_mangler(name, (), uid=uid)


def _named(module: str, name: str) -> object:
    try:
        return functools.reduce(getattr, name.split('.'), importlib.import_module(module))
    except (ImportError, AttributeError):
        return None


def _has_names(kind: types.Type) -> bool:
    """Return True if another process finds the classes of a numba type by their names. The class of a named tuple that
    has no name in its module would be another one after it is loaded."""
    of = getattr(kind, 'instance_class', None)
    members: Iterable[types.Type] = kind if isinstance(kind, types.BaseTuple) else ()
    return (of is None or _named(of.__module__, of.__qualname__) is of) and all(map(_has_names, members))


class _Call(NamedTuple):
    """A call of a law: what another process needs to find the called law again."""
    module: str
    name: str
    key: str          # '' for a separate law, which may change
    args: Types
    returns: types.Type

    @property
    def law(self) -> 'Law | None':
        """Called law; None if this process has another law, or none, under its name."""
        law = _named(self.module, self.name)
        return law if isinstance(law, Law) and self.key == ('' if law.separate else law.key) else None


def _calls(translations: list[_Translation]) -> list[_Call] | None:
    """Return the calls of the laws with these translations; None if another process cannot find a law or a type by its
    name. A law that is made inside a function has none."""
    calls = [_Call(part.law.py_func.__module__, part.law.py_func.__qualname__,
                   '' if part.law.separate else part.law.key, part.args,
                   part.law.translation(part.args).signature.return_type) for part in translations]
    return calls if all(call.law is part.law and part.law.goes_by_name == part.law.separate
                        and all(map(_has_names, (*call.args, call.returns)))
                        for call, part in zip(calls, translations)) else None


def _can_be_kept(law: 'Law', made: compiler.CompileResult) -> bool:
    """Return True if another process can use a CompileResult of a law, whose values are still those of its key."""
    signature = made.signature
    return (not made.library.has_dynamic_globals and all(map(_has_names, (*signature.args, signature.return_type)))
            and law_key.of_law(law) == law.key)


class _KeptTranslation(NamedTuple):
    """Cached form of a translation. fndesc, environment, signature: fields of numba's CompileResult."""
    code: bytes       # LLVM module as bitcode
    calls: list[_Call]
    fndesc: PythonFunctionDescriptor
    environment: Environment
    signature: typing.Signature


class _KeptExecutable(NamedTuple):
    separate: list[_Call]       # separate laws whose machine code it calls
    compiled: tuple[object, ...]    # numba's own form of a CompileResult


class _LawType(types.Dispatcher):
    """Numba's type of a Law in compiled code, a constant without a value: code with the value could not be cached."""


register_model(_LawType)(OpaqueModel)


@lower_constant(_LawType)
def _law_constant(context: BaseContext, builder: llvmlite.ir.IRBuilder, law_type: _LawType,
                  law: 'Law') -> llvmlite.ir.Value:
    return context.get_dummy_value()


_SEPARATE: dict[str, 'Law'] = {}
"""Separate laws of this process by their names, which stand in the machine code of their callers."""


class Law(CPUDispatcher):
    """Compiled law: a numba dispatcher, which translates the law once for each set of argument types (overload).

    An overload becomes an executable only when Python calls it, or when the law is separate: not contained in the
    machine code of its callers.
    """

    def __init__(self, *arguments: object, separate: bool = False, **keywords: object) -> None:
        super().__init__(*arguments, **keywords)
        self.separate = separate
        self._type = _LawType(self)
        self.typingctx._globals.pop(weakref.ref(self))     # remove the type that numba gave to the law
        self.typingctx.insert_global(self, self._type)
        self._translated: dict[Types, compiler.CompileResult] = {}
        # Of two laws of one name, as after a reload of a module, only the first one goes by the name.
        self.goes_by_name = separate and '<' not in self._name and _SEPARATE.setdefault(self._name, self) is self

    @property
    def _numba_type_(self) -> types.Type:
        return self._type

    @property
    def _name(self) -> str:
        return f'{self.py_func.__module__}.{self.py_func.__qualname__}'

    @functools.cached_property
    def key(self) -> str:
        """Key of the law (law_key)."""
        return law_key.of_law(self)

    def symbol(self, args: Types) -> str:
        """Return a digest that becomes part of the symbol of this law. That of a separate law outlives a change of the
        law, because the machine code of its callers contains it."""
        stands_for = self._name if self.goes_by_name else self.key
        return law_key.digest((stands_for, law_key.of_types(args)))

    def is_cached(self, *values: object) -> bool:
        """Return True if the executable for these values is in the law cache, with the separate laws that it calls."""
        return self._is_cached(tuple(map(self.typeof_pyval, values)))

    def _is_cached(self, args: Types) -> bool:
        kept = law_cache.load(self._file('executable', args))
        return isinstance(kept, _KeptExecutable) and all(
            (law := call.law) is not None and law._is_cached(call.args) for call in kept.separate)

    def _file(self, form: str, args: Types) -> pathlib.Path:
        return law_cache.file(self._name, _COMPILER, form, self.key, law_key.of_types(args))

    def get_call_template(self, args: Types,
                          kws: dict[str, types.Type]) -> tuple[type, typing.Signature, Types, dict[str, types.Type]]:
        """Return numba's template of a call from another law. Such a call needs the translation only."""
        signature, args = self._compiler.fold_argument_types(args, kws)
        self.translation(tuple(args))
        name = self.py_func.__name__
        template = typing.make_concrete_template(name, name, [made.signature for made in self._translated.values()])
        return template, signature, args, {}

    def get_overload(self, sig: object) -> _Translation:
        """Return the translation for a signature, by which numba finds the implementation of a call from a law."""
        args, _ = sigutils.normalize_signature(sig)
        return self._translated[tuple(args)].library

    def compile(self, sig: object) -> Callable[..., object]:
        """Return the entry point of the executable for a signature, for a call from Python."""
        args, _ = sigutils.normalize_signature(sig)
        return self.executable(tuple(args)).entry_point

    def executable(self, args: Types) -> compiler.CompileResult:
        """Return the CompileResult of the executable, which one process compiles while the others wait."""
        with global_compiler_lock:
            if args not in self.overloads:
                path = self._file('executable', args)
                made = self._load_executable(path)
                if made is None:
                    with law_cache.lock(path), _garbage_kept():
                        made = self._load_executable(path)
                        (self._cache_misses if made is None else self._cache_hits)[args] += 1
                        if made is None:
                            made = self._make_executable(args, path)
                else:
                    self._cache_hits[args] += 1
                self.add_overload(made)
            return self.overloads[args]

    def translation(self, args: Types) -> compiler.CompileResult:
        """Return the CompileResult of the translation, for calls from other laws."""
        if args not in self._translated:
            path = self._file('translation', args)
            made = self._load_translation(path, args)
            if made is None:
                made = self._translate(args)
                calls = _calls(made.library.calls)
                if calls is not None and _can_be_kept(self, made):
                    made.fndesc.typemap = made.fndesc.calltypes = None
                    law_cache.save(path, _KeptTranslation(made.library.code.as_bitcode(), calls, made.fndesc,
                                                          made.environment, made.signature))
            self.targetctx.insert_user_function(made.library, made.fndesc, [made.library])
            self._translated[args] = made
        return self._translated[args]

    def _translate(self, args: Types) -> compiler.CompileResult:
        flags = compiler.Flags()
        self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        library = _Translation(self.targetctx.codegen(), self, args)
        made = compiler.compile_extra(self.typingctx, self.targetctx, self.py_func, args, None, flags, self.locals,
                                      library, _Compiler)
        library.finalize()
        return made

    def _load_translation(self, path: pathlib.Path, args: Types) -> compiler.CompileResult | None:
        kept = law_cache.load(path)
        if not isinstance(kept, _KeptTranslation):
            return None
        called = []
        for call in kept.calls:
            law = call.law
            if law is None or law.translation(call.args).signature.return_type != call.returns:
                return None
            called.append(law.translation(call.args))
        library = _Translation(self.targetctx.codegen(), self, args)
        library._final_module = llvmlite.binding.parse_bitcode(kept.code)
        library._linking_libraries = [now.library for now in called]
        library._finalized = True
        return compiler.compile_result(
            typing_context=self.typingctx, target_context=self.targetctx, entry_point=None, typing_error=None,
            type_annotation='', library=library, call_helper=None, signature=kept.signature, objectmode=False,
            lifted=(), fndesc=kept.fndesc, environment=kept.environment, metadata=None, reload_init=())

    def _make_executable(self, args: Types, path: pathlib.Path) -> compiler.CompileResult:
        law = self.translation(args)
        separate = law.library.parts[1]
        for part in separate:
            part.law._link(part.args)
        # As numba's compiler does for the law: the wrapper owns the arrays that it returns.
        context = self.targetctx.subtarget(enable_nrt=True)
        context.refresh()
        library = context.codegen().create_library(law.fndesc.qualname)
        library.enable_object_caching()
        library.add_linking_library(law.library)
        # The wrapper for Python has constants of its own, such as the type of a returned array. They are in an
        # environment of its own: that of the law is part of the translation, and complete before.
        wrapper = copy.copy(law.fndesc)
        wrapper.env_name = f'{law.fndesc.env_name}.wrapper'
        environment = Environment.from_fndesc(wrapper)
        with context.push_code_library(library):
            context.create_cpython_wrapper(library, wrapper, environment, law.call_helper)
        made = law._replace(library=library, fndesc=wrapper, environment=environment,
                            entry_point=context.get_executable(library, wrapper, environment))
        for referenced in made._find_referenced_environments():
            library.codegen.set_env(referenced.env_name, referenced)
        calls = _calls(separate)
        if calls is not None and _can_be_kept(self, made):
            law_cache.save(path, _KeptExecutable(calls, made._reduce()))
        return made

    def _load_executable(self, path: pathlib.Path) -> compiler.CompileResult | None:
        kept = law_cache.load(path)
        if not isinstance(kept, _KeptExecutable):
            return None
        # To prepare numba's compiler takes a third of a second and imports all of scipy.linalg. Machine code needs the
        # run-time library only.
        rtsys.initialize(self.targetctx)
        for call in kept.separate:
            law = call.law
            if law is None or law._link(call.args) != call.returns:
                return None
        return compiler.CompileResult._rebuild(self.targetctx, *kept.compiled)

    def _link(self, args: Types) -> types.Type:
        """Make the code of a separate law known to the executables that call it; return the type of its result."""
        made = self.executable(args)
        name = made.fndesc.llvm_func_name
        llvmlite.binding.add_symbol(name, made.library.get_pointer_to_function(name))
        return made.signature.return_type


@contextlib.contextmanager
def _garbage_kept() -> Iterator[None]:
    """Switch off the garbage collector, which searches all objects of the compiler and finds little."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def by_type(function: Callable[..., object], law_of: Callable[[types.Type], Law | None]) -> None:
    """Let compiled code call `function`, which stands for the Law that law_of(type of the first argument) returns, or
    None for a call that does nothing. Numba's `overload` would make an executable of each of these laws."""
    law_key.template(function, law_of)

    @type_callable(function)
    def type_call(context: BaseContext) -> Callable[..., types.Type]:
        def returned(*args: types.Type) -> types.Type:
            law = law_of(args[0])
            return types.none if law is None else context.resolve_function_type(law._type, args, {}).return_type
        vars(returned)['__signature__'] = inspect.signature(function)
        return returned

    @lower_builtin(function, types.VarArg(types.Any))
    def call(context: BaseContext, builder: llvmlite.ir.IRBuilder, signature: typing.Signature,
             args: Sequence[llvmlite.ir.Value]) -> llvmlite.ir.Value:
        law = law_of(signature.args[0])
        if law is None:
            return context.get_dummy_value()
        known = context.typing_context.resolve_function_type(law._type, signature.args, {})
        return context.get_function(law._type, known)(builder, args)


_COMPILER = law_key.of_module(sys.modules[__name__])
"""Text that changes with this module, whose code makes the code of the laws."""
