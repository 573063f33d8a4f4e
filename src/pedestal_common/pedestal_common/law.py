"""Compiler of the laws, which the decorator `compiled` uses in place of numba's own dispatcher.

A law that only other laws call is translated to LLVM's intermediate code, and no more. A law that Python calls becomes
an executable: machine code of this law with all the laws that it calls. Numba itself makes machine code and a wrapper
for Python of each function, and optimises the function again in each of its callers. Because Python calls only ten of
500 laws, this would double the time of compilation.
"""
import functools
import hashlib
import importlib
import inspect
import weakref
from typing import NamedTuple

from llvmlite.binding import Linkage, parse_bitcode
from numba.core import compiler, sigutils, types, typing
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.datamodel.models import OpaqueModel
from numba.core.funcdesc import default_mangler
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.extending import lower_builtin, register_model, type_callable

from pedestal_common import law_cache


class _Translation(JITCodeLibrary):
    """Translation: LLVM code of one Law for arguments of the types `args`, not yet linked with the laws that it calls.
    """

    def __init__(self, codegen, law, args):
        super().__init__(codegen, law.py_func.__qualname__)
        self.law, self.args = law, args

    @property
    def calls(self):
        """Translations of the laws that this law calls."""
        return [library for library in self._linking_libraries if isinstance(library, _Translation)]

    @property
    def code(self):
        """LLVM module of this law, without the laws that it calls."""
        return self._final_module

    def add_llvm_module(self, ll_module):
        """Add an LLVM module. Numba would also optimise each function here. This is left out, because the whole
        executable is optimised later."""
        self._final_module.link_in(ll_module)

    def finalize(self):
        """Complete the code of this law with the functions of numba's libraries that it calls.

        Numba numbers its own functions in the order of their use, so two processes give different functions the same
        symbol. The functions of numba are therefore internal to this module. Otherwise the linker would take the
        function of another translation for them.
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

    def _get_module_for_linking(self):
        """Return one LLVM module of this law with all the laws that it calls."""
        if self._shared_module is None:
            parts = [self]
            for part in parts:      # the list grows in the loop
                parts += [called for called in part.calls if called not in parts]
            modules = [part.code.clone() for part in parts]
            modules.append(rtsys.library._get_module_for_linking().clone())
            while len(modules) > 1:     # linked in pairs, because the time of a link grows with the size of both
                for one, other in zip(modules[::2], modules[1::2]):
                    one.link_in(other)
                modules = modules[::2]
            self._shared_module = modules[0]
            _relink(self._shared_module, Linkage.weak_odr, 'linkonce_odr')
        return self._shared_module


def _relink(module, before, after):
    """Give the linkage `after` to the functions of an LLVM module that have the linkage `before`.

    With weak_odr the linker keeps one of several equal functions. With linkonce_odr it also drops a function that has
    been inlined everywhere.
    """
    for function in module.functions:
        if not function.is_declaration and function.linkage == before:
            function.linkage = after


class _Compiler(compiler.Compiler):
    """Numba's compiler, which gives a law the same symbol (name in the machine code) in every process.

    A process can therefore use the translation that another process has cached. Numba's own symbols number the laws
    and the types of records in the order of their use, which differs from process to process.
    """

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.state.targetctx = self.state.targetctx.subtarget(mangler=_symbol)

    def _compile_bytecode(self):
        identity = self.state.func_id
        if _has_name(identity.func_qualname):
            identity.unique_id = int.from_bytes(hashlib.sha256(repr(self.state.args).encode()).digest()[:6])
            identity.unique_name = f'{identity.func_qualname}${identity.unique_id}'
        return super()._compile_bytecode()


def _symbol(name, types, *, abi_tags=(), uid=None):
    """Return the symbol of a law. uid: number that stands for the types of its arguments."""
    return default_mangler(name, (), uid=uid)


def _has_name(qualname):
    """Return True if a law can be imported by its qualified name. A law that is made inside a function cannot: its
    name contains '<locals>'."""
    return '<' not in qualname


class _Kept(NamedTuple):
    """Cached form of a translation.

    args     types of the arguments of the law
    code     its LLVM module as bitcode
    calls    [(module, name, types of the arguments)] of the laws that it calls
    fndesc, environment, signature    fields of numba's CompileResult
    """
    args: tuple
    code: bytes
    calls: list
    fndesc: object
    environment: object
    signature: object


class _Translated(law_cache.Contents):
    """Conversion of a translation to its cached form (_Kept) and back."""

    def get_filename_base(self, fullname, abiflags):
        """Return the base of the name of the file, which is in the same folder as that of the executable."""
        return f'{super().get_filename_base(fullname, abiflags)}.ir'

    def check_cachable(self, cres):
        """Return True if another process can find the law, and the laws that it calls, by their names."""
        return super().check_cachable(cres) and all(
            _has_name(part.law.py_func.__qualname__) for part in (cres.library, *cres.library.calls))

    def reduce(self, cres):
        """Return the _Kept of numba's CompileResult, which can be pickled."""
        cres.fndesc.typemap = cres.fndesc.calltypes = None
        laws = [(part.law.py_func, part.args) for part in cres.library.calls]
        calls = [(function.__module__, function.__qualname__, args) for function, args in laws]
        return _Kept(cres.library.args, cres.library.code.as_bitcode(), calls, cres.fndesc, cres.environment,
                     cres.signature)

    def rebuild(self, target_context, payload):
        """Return the CompileResult of a _Kept, the result of `reduce`."""
        fndesc = payload.fndesc
        library = _Translation(target_context.codegen(), _named(fndesc.modname, fndesc.qualname), payload.args)
        library._final_module = parse_bitcode(payload.code)
        library._linking_libraries = [_named(module, name).translation(args).library
                                      for module, name, args in payload.calls]
        library._finalized = True
        return compiler.compile_result(
            typing_context=target_context.typing_context, target_context=target_context, entry_point=None,
            typing_error=None, type_annotation='', library=library, call_helper=None, signature=payload.signature,
            objectmode=False, lifted=(), fndesc=fndesc, environment=payload.environment, metadata=None, reload_init=())


class _Translations(law_cache.Cache):
    """Cached translations of one law, one for each set of argument types."""
    _impl_class = _Translated


def _named(module, name):
    """Return the Law with a qualified name in a module."""
    return functools.reduce(getattr, name.split('.'), importlib.import_module(module))


class _LawType(types.Dispatcher):
    """Numba's type of a Law in compiled code. There a Law is a constant without a value, because code with the value
    could not be cached."""


register_model(_LawType)(OpaqueModel)


@lower_constant(_LawType)
def _law_constant(context, builder, law_type, law):
    return context.get_dummy_value()


class Law(CPUDispatcher):
    """Compiled law: a numba dispatcher, which translates the law once for each set of argument types (overload).

    An overload becomes an executable only when Python calls it. Translations and executables are cached.
    """

    def __init__(self, *arguments, **keywords):
        super().__init__(*arguments, **keywords)
        self._type = _LawType(self)
        self.typingctx._globals.pop(weakref.ref(self))     # remove the type that numba gave to the law
        self.typingctx.insert_global(self, self._type)
        self._translated, self._translations = {}, NullCache()

    @property
    def _numba_type_(self):
        return self._type

    def enable_caching(self):
        """Cache the compiled law if the law cache has a folder for it."""
        if law_cache.folder(self.py_func) is not None:
            self._cache, self._translations = law_cache.Cache(self.py_func), _Translations(self.py_func)

    def get_call_template(self, args, kws):
        """Return numba's template of a call from another law. Such a call needs the translation only."""
        signature, args = self._compiler.fold_argument_types(args, kws)
        self.translation(tuple(args))
        name = self.py_func.__name__
        template = typing.make_concrete_template(name, name, [made.signature for made in self._translated.values()])
        return template, signature, args, {}

    def get_overload(self, sig):
        """Return the translation for a signature, by which numba finds the implementation of a call from a law."""
        args, _ = sigutils.normalize_signature(sig)
        return self._translated[tuple(args)].library

    def compile(self, sig):
        """Return the entry point of the executable for a signature, for a call from Python."""
        args, _ = sigutils.normalize_signature(sig)
        with global_compiler_lock:
            if args not in self.overloads:
                made = self._cache.load_overload(args, self.targetctx)
                (self._cache_misses if made is None else self._cache_hits)[args] += 1
                if made is None:
                    made = _executable(self.translation(args))
                    self._cache.save_overload(args, made)
                self.add_overload(made)
            return self.overloads[args].entry_point

    def translation(self, args):
        """Return the CompileResult of the translation for arguments of these types, for calls from other laws."""
        if args not in self._translated:
            made = self._translations.load_overload(args, self.targetctx)
            if made is None:
                made = self._translate(args)
                self._translations.save_overload(args, made)
            self.targetctx.insert_user_function(made.library, made.fndesc, [made.library])
            self._translated[args] = made
        return self._translated[args]

    def _translate(self, args):
        """Return the CompileResult of a new translation for arguments of these types."""
        flags = compiler.Flags()
        self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        library = _Translation(self.targetctx.codegen(), self, args)
        made = compiler.compile_extra(self.typingctx, self.targetctx, self.py_func, args, None, flags, self.locals,
                                      library, _Compiler)
        library.finalize()
        return made


def _executable(law):
    """Return the CompileResult of an executable, which contains all the laws that a law calls. law: CompileResult of
    its translation."""
    context = law.target_context
    context.refresh()
    library = context.codegen().create_library(law.fndesc.qualname)
    library.enable_object_caching()
    library.add_linking_library(law.library)
    with context.push_code_library(library):
        context.create_cpython_wrapper(library, law.fndesc, law.environment, law.call_helper)
    made = law._replace(library=library, entry_point=context.get_executable(library, law.fndesc, law.environment))
    for environment in made._find_referenced_environments():
        library.codegen.set_env(environment.env_name, environment)
    return made


def by_type(function, law_of):
    """Let compiled code call `function`, which stands for a Law that depends on the type of its first argument.

    law_of(type of the first argument) returns the Law, or None if the call does nothing. Numba's own function
    `overload` is not used, because it would make an executable of each of these laws.
    """
    @type_callable(function)
    def type_call(context):
        def returned(*args):
            law = law_of(args[0])
            return types.none if law is None else context.resolve_function_type(law._type, args, {}).return_type
        returned.__signature__ = inspect.signature(function)
        return returned

    @lower_builtin(function, types.VarArg(types.Any))
    def call(context, builder, signature, args):
        law = law_of(signature.args[0])
        if law is None:
            return context.get_dummy_value()
        known = context.typing_context.resolve_function_type(law._type, signature.args, {})
        return context.get_function(law._type, known)(builder, args)
