#pragma once

namespace plumb {

/// From here on the calling thread goes before all others, and the process has no page faults: memory is locked, what the
/// heap gives back stays with us, and the stack that a cycle needs has been touched. Threads that were made before keep
/// their priority.
/// @param priority of SCHED_FIFO, 1 to 90: the kernel's own threads must be able to go before us. 0 = do nothing.
/// @throws std::runtime_error with the cure if the system refuses.
void BecomeRealtime(int priority);

}  // namespace plumb
