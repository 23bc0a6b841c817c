#include "tests/support/terminal.h"

#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>

namespace nodal::test {

Shown run_in_terminal(const std::vector<std::string>& command, const std::map<std::string, std::string>& environment,
                      const Terminal& like) {
  winsize size{};
  size.ws_row = like.rows;
  size.ws_col = like.columns;
  int terminal = -1;
  const pid_t pid = ::forkpty(&terminal, nullptr, nullptr, &size);
  if (pid < 0) std::abort();
  if (pid == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (const auto& [name, value] : environment) ::setenv(name.c_str(), value.c_str(), 1);
    std::vector<char*> words;
    for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
    words.push_back(nullptr);
    ::execvp(words[0], words.data());
    ::_exit(127);
  }
  Shown shown;
  if (::write(terminal, like.typed.data(), like.typed.size()) < 0) std::abort();
  const auto end = std::chrono::steady_clock::now() + like.at_most;
  std::array<char, 65536> buffer;
  while (true) {
    pollfd ready{terminal, POLLIN, 0};
    if (std::chrono::steady_clock::now() > end) ::kill(pid, SIGKILL);
    if (::poll(&ready, 1, 1000) <= 0) continue;
    const ssize_t got = ::read(terminal, buffer.data(), buffer.size());
    if (got <= 0) break;  // EIO: every program has closed the terminal
    shown.text.append(buffer.data(), static_cast<std::size_t>(got));
  }
  int status = 0;
  ::waitpid(pid, &status, 0);
  ::close(terminal);
  shown.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return shown;
}

std::size_t widest_line(const std::string& text) {
  std::size_t widest = 0, width = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c == '\x1b') {
      // Control sequences end with a letter (ECMA-48, 5.4).
      while (i + 1 < text.size() && std::isalpha(static_cast<unsigned char>(text[i])) == 0) ++i;
    } else if (c == '\n' || c == '\r') {
      width = 0;
    } else if ((c & 0xC0) != 0x80) {
      widest = std::max(widest, ++width);
    }
  }
  return widest;
}

}  // namespace nodal::test
