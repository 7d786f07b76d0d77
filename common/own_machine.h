#pragma once

namespace plumb {

/// From now on the socket receives only what this machine has sent, whatever sender a datagram from
/// outside claims. Before bind, or some may have come already. Thread-safe.
/// @param fd of an IPv4 datagram socket. @throws std::system_error if the kernel refuses.
void AdmitOwnMachineOnly(int fd);

}  // namespace plumb
