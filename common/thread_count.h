#pragma once

namespace plumb {

/// How many threads to work with: as many as were asked for, or for 0 one for each core, the cores
/// divided among the ranks of this machine; at least one. Thread-safe.
int ThreadCount(int asked, int ranks_here = 1);

}  // namespace plumb
