#pragma once

// Ctrl-C and its kin, for commands that stop at a good place.

#include <csignal>

namespace piecework::cli {

/// The signal that asked to stop since the guard was made; 0: none.
int stop_signal();

/// While it lives, the first Ctrl-C or SIGTERM only sets stop_signal(); a second one kills.
class SignalGuard {
 public:
  SignalGuard();
  ~SignalGuard();
  SignalGuard(const SignalGuard&) = delete;
  SignalGuard& operator=(const SignalGuard&) = delete;

 private:
  struct sigaction old_int_ {};
  struct sigaction old_term_ {};
  struct sigaction old_pipe_ {};
};

}  // namespace piecework::cli
