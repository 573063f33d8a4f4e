"""Compiler of laws: a law that other laws call is only translated to LLVM's intermediate code; a law that Python calls
becomes one piece of machine code with all the laws that it calls.

Numba makes machine code and a wrapper for Python of each function, and optimises the function again in each of its
callers. Of 500 laws Python calls ten, so that doubles the time of compilation.
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
    """Code of a Law for args, as numba translated it, to be linked with that of the laws it calls."""

    def __init__(self, codegen, law, args):
        super().__init__(codegen, law.py_func.__qualname__)
        self.law, self.args = law, args

    @property
    def calls(self):
        """Translations of the laws that it calls."""
        return [library for library in self._linking_libraries if isinstance(library, _Translation)]

    @property
    def code(self):
        """Its module, without the laws that it calls."""
        return self._final_module

    def add_llvm_module(self, ll_module):
        """Add a module without the passes over each function, because the whole is optimised when it is made
        executable."""
        self._final_module.link_in(ll_module)

    def finalize(self):
        """Complete the code with numba's own functions."""
        for library in self._linking_libraries:
            if not isinstance(library, _Translation) and library is not rtsys.library:
                self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        _relink(self._final_module, Linkage.external, 'weak_odr')
        self._finalize_dynamic_globals()
        self._finalized = True

    def _get_module_for_linking(self):
        """Return its module with all the laws that it calls."""
        if self._shared_module is None:
            parts = [self]
            for part in parts:      # grows in the loop
                parts += [called for called in part.calls if called not in parts]
            modules = [part.code.clone() for part in parts]
            modules.append(rtsys.library._get_module_for_linking().clone())
            while len(modules) > 1:     # in pairs, because the time of a link grows with both modules
                for one, other in zip(modules[::2], modules[1::2]):
                    one.link_in(other)
                modules = modules[::2]
            self._shared_module = modules[0]
            _relink(self._shared_module, Linkage.weak_odr, 'linkonce_odr')
        return self._shared_module


def _relink(module, before, after):
    """Change the linkage of the functions that have the linkage `before`. With weak_odr one of equal functions is
    kept; with linkonce_odr a function that has been inlined everywhere is dropped."""
    for function in module.functions:
        if not function.is_declaration and function.linkage == before:
            function.linkage = after


class _Compiler(compiler.Compiler):
    """Numba's compiler, with the same symbol for a law in every process, so that one process finds the translation of
    another. Numba's own symbols number the laws and the types of records in the order of their use."""

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
    """Return the symbol of a law; uid contains its types."""
    return default_mangler(name, (), uid=uid)


def _has_name(qualname):
    """Return True if a module has the law by this name; a law that a function makes has none."""
    return '<' not in qualname


class _Kept(NamedTuple):
    """Cached translation: its code as bitcode, and [(module, name, types)] of the laws that it calls."""
    args: tuple
    code: bytes
    calls: list
    fndesc: object
    environment: object
    signature: object


class _Translated(law_cache.Contents):
    """Format of a cached translation."""

    def get_filename_base(self, fullname, abiflags):
        """Return the name of the file, which is beside the executable."""
        return f'{super().get_filename_base(fullname, abiflags)}.ir'

    def check_cachable(self, cres):
        """Return True if another process would find the law, and the laws that it calls, by their names."""
        return super().check_cachable(cres) and all(
            _has_name(part.law.py_func.__qualname__) for part in (cres.library, *cres.library.calls))

    def reduce(self, cres):
        """Return a form of a CompileResult that can be pickled."""
        cres.fndesc.typemap = cres.fndesc.calltypes = None
        laws = [(part.law.py_func, part.args) for part in cres.library.calls]
        calls = [(function.__module__, function.__qualname__, args) for function, args in laws]
        return _Kept(cres.library.args, cres.library.code.as_bitcode(), calls, cres.fndesc, cres.environment,
                     cres.signature)

    def rebuild(self, target_context, payload):
        """Return the CompileResult of a result of `reduce`."""
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
    _impl_class = _Translated


def _named(module, name):
    """Return the Law of this name in a module."""
    return functools.reduce(getattr, name.split('.'), importlib.import_module(module))


class _LawType(types.Dispatcher):
    """Type of a Law that compiled code names: a constant without its value, which could not be cached."""


register_model(_LawType)(OpaqueModel)


@lower_constant(_LawType)
def _law_constant(context, builder, law_type, law):
    return context.get_dummy_value()


class Law(CPUDispatcher):
    """Compiled law: numba's dispatcher, of which every overload is translated, and made executable when Python calls
    it. Both are cached."""

    def __init__(self, *arguments, **keywords):
        super().__init__(*arguments, **keywords)
        self._type = _LawType(self)
        self.typingctx._globals.pop(weakref.ref(self))     # the type that numba gave it
        self.typingctx.insert_global(self, self._type)
        self._translated, self._translations = {}, NullCache()

    @property
    def _numba_type_(self):
        return self._type

    def enable_caching(self):
        """Cache the compiled law where there is a folder for it."""
        if law_cache.folder(self.py_func) is not None:
            self._cache, self._translations = law_cache.Cache(self.py_func), _Translations(self.py_func)

    def get_call_template(self, args, kws):
        """Return the template of a call from compiled code, for which the law need not be executable."""
        signature, args = self._compiler.fold_argument_types(args, kws)
        self.translation(tuple(args))
        name = self.py_func.__name__
        template = typing.make_concrete_template(name, name, [made.signature for made in self._translated.values()])
        return template, signature, args, {}

    def get_overload(self, sig):
        """Return the library of a signature, for the target."""
        args, _ = sigutils.normalize_signature(sig)
        return self._translated[tuple(args)].library

    def compile(self, sig):
        """Return the entry point for these types, for a call from Python."""
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
        """Return the translation for arguments of these types, for calls from other laws."""
        if args not in self._translated:
            made = self._translations.load_overload(args, self.targetctx)
            if made is None:
                made = self._translate(args)
                self._translations.save_overload(args, made)
            self.targetctx.insert_user_function(made.library, made.fndesc, [made.library])
            self._translated[args] = made
        return self._translated[args]

    def _translate(self, args):
        flags = compiler.Flags()
        self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        library = _Translation(self.targetctx.codegen(), self, args)
        made = compiler.compile_extra(self.typingctx, self.targetctx, self.py_func, args, None, flags, self.locals,
                                      library, _Compiler)
        library.finalize()
        return made


def _executable(law):
    """Return a translated law as a CompileResult with an entry point, of a library with all the laws that it calls."""
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
    """Let compiled code call a function that is the Law law_of(type of its first argument); None: the call does
    nothing.

    numba.extending.overload would make an executable of each law.
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
