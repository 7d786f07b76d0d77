#pragma once

namespace CLI {
class App;
}

namespace plumb {

/// Greatest priority that may be asked for: the kernel's own threads must be able to go before us.
inline constexpr int kHighestPriority = 90;

/// From here on the calling thread, and threads that it makes from then on, go before all others,
/// and the process has no page faults: memory is locked, what the heap gives back stays with us,
/// and the stack that a cycle needs has been touched. Threads that were made before keep their
/// priority.
/// @param priority of SCHED_FIFO, 1 to kHighestPriority. 0 = do nothing.
/// @throws std::runtime_error with the cure if the system refuses.
void BecomeRealtime(int priority);

/// Gives the calling thread ordinary priority. Does nothing where it has that already.
void BecomeOrdinary() noexcept;

/// --realtime-priority, 0 = off.
void AddRealtimeFlag(CLI::App& app, int& priority);

}  // namespace plumb
