/// Handling of exceptions that reach no caller: exhausted memory inside a destructor or in a thread of a library.
#pragma once

namespace supple::tool {

/// From before main on the program ends with a message and the exit code of its kind where it would abort: a limit where memory ran out, else an
/// internal error. Temporary files that are being written are removed; finished files are complete.
/// This reserves some memory, which is freed when no more is left, so that messages can be made.
void prepare_last_resort();

}  // namespace supple::tool
