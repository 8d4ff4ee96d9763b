/// What the tool does where an exception can reach no caller: memory that ends inside a destructor or in a thread of a library.
#pragma once

namespace supple::tool {

/// From now on the program ends with a message and the exit code of its kind where it would abort: a limit where memory ran out, else an
/// internal fault. Temporary files that are being written are removed; finished files are whole, as they got their names when they were.
/// Keeps some memory aside, which is let go where no more is left, so that messages can be made.
void prepare_last_resort();

}  // namespace supple::tool
