// Counts the calls of operator new, in test programs that link counted_new.cpp.
#pragma once

namespace limber::testing {

/// Calls of any form of operator new so far, in any thread.
long allocations();

}  // namespace limber::testing
