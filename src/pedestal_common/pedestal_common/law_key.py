"""Key of a law: a digest of everything on which its compiled code depends. The law cache cannot confuse two laws.

The key is made of the functions and values in memory, which are those that the compiler reads. A source file that is
edited while a process runs therefore cannot give new code the key of old code. Comments, docstrings, line numbers and
the place of a file are not part of a key.

The values of a law are found by the global and attribute names of its code, also those of other functions of the same
name. A key thus depends on a little more than the law, which costs a needless compilation at most.
"""
import enum
import hashlib
import sys
import types
from collections.abc import Callable, Iterable

import numpy as np
from numba.core import types as numba_types
from numba.core.registry import CPUDispatcher

FOREIGN_PACKAGES = frozenset({*sys.stdlib_module_names, 'numpy', 'numba', 'llvmlite', 'scipy'}) - {'builtins'}
"""Packages whose code does not change between two releases of Python and of the libraries; the cache knows these. A
function that is made from a text names `builtins` as its module."""

_PLAIN = bool, int, float, complex, str, bytes, type(None), np.generic, np.dtype, np.ndarray, enum.Enum
"""Classes of values that need no other value to be described."""


def digest(parts: Iterable[str]) -> str:
    """Return a digest of texts, 32 hexadecimal digits."""
    sha = hashlib.sha256()
    for part in parts:
        content = part.encode()
        sha.update(f'{len(content)}\n'.encode() + content)
    return sha.hexdigest()[:32]


def of_law(law: CPUDispatcher, whole: bool = False) -> str:
    """Return the key of a law (law.Law), with the laws that it calls and their values. Of a separate law only the name
    is part of the key, unless `whole`: the law cache checks the type of its result."""
    found, todo = {}, [law]
    while todo:
        part = todo.pop()
        if part not in found:
            text, called = _of_function(part.py_func)
            found[part] = f'{_name(part.py_func)} {part.targetoptions} {text}'
            todo += [other for other in called if whole or not other.goes_by_name]
    return digest(sorted(found.values()))


def of_types(args: tuple[numba_types.Type, ...]) -> str:
    """Return a text that identifies numba's types of arguments, with the field names of named tuples."""
    return f'({",".join(map(_of_type, args))})'


def template(function: Callable[..., object], *values: object) -> None:
    """Mark a function that numba's `overload` or `type_callable` lets laws call. values: what chooses or makes the
    compiled code, in addition to the module of the function."""
    vars(function)['template_values'] = values


def _of_type(kind: numba_types.Type) -> str:
    parts = [f'{type(kind).__name__} {kind}']
    if isinstance(kind, numba_types.BaseTuple):
        members: Iterable[numba_types.Type] = kind
        parts += [_of_type(member) for member in members]
    parts += [_of_type(part) for name in ('dtype', 'type', 'key_type', 'value_type')
              if isinstance(part := getattr(kind, name, None), numba_types.Type) and part is not kind]
    if hasattr(kind, 'instance_class'):
        parts.append(_of_class(kind.instance_class))
    if isinstance(kind, numba_types.Dispatcher):
        parts.append(of_law(kind.dispatcher))
    if not _is_foreign(type(kind).__module__):      # a type of lanes: its methods are part of the compiled code
        parts.append(of_module(sys.modules[type(kind).__module__]))
    return ' '.join(parts)


def _is_foreign(module: str) -> bool:
    return module.partition('.')[0] in FOREIGN_PACKAGES


def _name(thing: Callable[..., object]) -> str:
    return f'{thing.__module__}.{thing.__qualname__}'


def _names(code: types.CodeType) -> set[str]:
    return {*code.co_names, *(name for part in code.co_consts if isinstance(part, types.CodeType)
                              for name in _names(part))}


def _of_code(code: types.CodeType, docstring: str | None = None) -> str:
    constants = [_of_code(part) if isinstance(part, types.CodeType) else
                 f'{type(part).__name__} {sorted(map(repr, part)) if isinstance(part, frozenset) else repr(part)}'
                 for part in code.co_consts]
    if docstring is not None and code.co_consts[:1] == (docstring,):
        constants[0] = 'NoneType None'     # as without a docstring
    arguments = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags & 0xff
    return f'{code.co_code.hex()} {arguments} {code.co_varnames} {code.co_names} {code.co_freevars} {constants}'


def _of_function(function: types.FunctionType) -> tuple[str, set[CPUDispatcher]]:
    """Return (text of a function and of the values that it names, laws that it names)."""
    laws: set[CPUDispatcher] = set()
    return digest([_Values(set(), laws).of_code(function)]), laws


def of_module(module: types.ModuleType) -> str:
    """Return the text of a module: the code of all its functions and methods, and its plain values; no laws."""
    found: list[str] = []

    def add(things: Iterable[object]) -> None:
        for thing in things:
            thing = getattr(thing, 'fget', getattr(thing, 'func', thing))       # of a property
            thing = thing if hasattr(thing, 'py_func') else getattr(thing, '__wrapped__', thing)
            if isinstance(thing, types.FunctionType):
                found.append(f'{thing.__qualname__} {_of_code(thing.__code__, thing.__doc__)} {thing.__defaults__!r}')
            elif isinstance(thing, type) and thing.__module__ == module.__name__:
                add(vars(thing).values())
    add(list(vars(module).values()))
    plain = _Values(set(), set())
    found += [f'{name}={plain.text(value)}' for name, value in vars(module).items()
              if not name.startswith('__') and isinstance(value, _PLAIN)]
    return digest(sorted(found))


def _of_class(kind: type) -> str:
    """Return the text of a class: with its members, if it is an enumeration, or its fields, if a named tuple."""
    if issubclass(kind, enum.Enum):
        return f'{_name(kind)} {[(name, member.value) for name, member in kind.__members__.items()]}'
    return f'{_name(kind)} {getattr(kind, "_fields", "")} {getattr(kind, "_field_defaults", "")}'


class _Values:
    """Texts of values that a function names. names: its names; laws: filled with the laws among the values."""

    def __init__(self, names: set[str], laws: set[CPUDispatcher]) -> None:
        self._names, self._laws = names, laws
        self._open: set[int] = set()      # ids of what is being described: a module may name itself

    def text(self, value: object) -> str:
        if id(value) in self._open:
            return 'itself'
        self._open.add(id(value))
        try:
            return self._text(value)
        finally:
            self._open.remove(id(value))

    def _text(self, value: object) -> str:
        kind = type(value).__name__
        if hasattr(value, 'separate') and hasattr(value, 'py_func'):
            self._laws.add(value)
            code = value.py_func.__code__
            names = code.co_varnames[:code.co_argcount + code.co_kwonlyargcount]
            return (f'law {_name(value.py_func)} {names} {code.co_argcount} {code.co_flags & 0xc} '
                    f'{value.py_func.__defaults__}')
        if isinstance(value, enum.Enum):
            return f'{_of_class(type(value))} {value.name}'
        if isinstance(value, types.ModuleType):
            return self._of_module(value)
        if isinstance(value, type):
            return _of_class(value)
        if isinstance(value, np.ndarray):
            return f'{value.dtype!r} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}'
        if isinstance(value, dict):
            return f'{kind} {[(self.text(key), self.text(item)) for key, item in value.items()]}'
        if isinstance(value, (tuple, list)):
            return f'{_of_class(type(value))} {[self.text(item) for item in value]}'
        if isinstance(value, numba_types.Type):
            return _of_type(value)
        if isinstance(value, np.void):
            return f'{value.dtype!r} {value.tobytes().hex()}'
        if isinstance(value, _PLAIN):
            return f'{kind} {value!r}'
        if isinstance(value, types.FunctionType) and hasattr(value, 'template_values'):
            return ' '.join((of_module(sys.modules[value.__module__]), self.of_code(value), *(
                self.of_code(part) if isinstance(part, types.FunctionType) else self.text(part)
                for part in value.template_values)))
        if isinstance(value, types.FunctionType):
            return kind     # numba does not compile it
        if hasattr(value, 'py_func') and not _is_foreign(value.__module__):         # numba's own njit
            return self.of_code(value.py_func)
        if hasattr(value, '__wrapped__') and not _is_foreign(value.__module__):     # an intrinsic of numba
            return f'{of_module(sys.modules[value.__module__])} {self.of_code(value.__wrapped__)}'
        return kind

    def _of_module(self, module: types.ModuleType) -> str:
        """Return the text of what the function names of a module; '' of a module of Python or of a library."""
        if _is_foreign(module.__name__):
            return module.__name__
        found = vars(module)
        return f'{module.__name__} {[(name, self.text(found[name])) for name in sorted(self._names & found.keys())]}'

    def of_code(self, function: types.FunctionType) -> str:
        """Return the text of a function that numba compiles or calls, with the values that it names and encloses."""
        inside = _Values(_names(function.__code__), self._laws)
        inside._open = self._open
        values = [function.__defaults__, *(cell.cell_contents for cell in function.__closure__ or ()),
                  *(function.__globals__[name] for name in sorted(inside._names) if name in function.__globals__)]
        return f'{_of_code(function.__code__, function.__doc__)} {[inside.text(value) for value in values]}'
