#include <fmt/format.h>

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <optional>
#include <utility>

#include "hal/linux/link/descriptor_link.h"
#include "hal/linux/link/signals.h"
#include "hal/linux/link/socket_link.h"

namespace nodal::hal {
namespace {

constexpr int kPatienceMs = 1000;  // how long a program may run after its input was closed
constexpr int kExitCodeMs = 200;   // how long its exit status may come after the end of its output

/// Readable once the process has ended. By syscall number, because glibc 2.36's wrapper has broken C++ linkage.
Descriptor open_process(pid_t process) { return Descriptor(static_cast<int>(::syscall(SYS_pidfd_open, process, 0))); }

class SpawnedLink final : public DescriptorLink {
 public:
  SpawnedLink(Descriptor socket, int fd, pid_t process, std::string command)
      : DescriptorLink(std::move(socket), fd, std::move(command)), process_(process), handle_(open_process(process)) {}

  ~SpawnedLink() override {
    close_descriptors();
    for (const int signal : {0, SIGTERM, SIGKILL}) {
      if (exit_) return;
      if (signal != 0) ::kill(process_, signal);
      wait(kPatienceMs);
    }
  }
  SpawnedLink(const SpawnedLink&) = delete;
  SpawnedLink& operator=(const SpawnedLink&) = delete;

 private:
  /// Collects the program's exit status if it ends in time.
  void wait(int patience_ms) {
    if (exit_) return;
    pollfd done{handle_.get(), POLLIN, 0};
    while (handle_.get() >= 0 && ::poll(&done, 1, patience_ms) < 0 && errno == EINTR) {}
    int status = 0;
    if (::waitpid(process_, &status, WNOHANG) == process_) exit_ = status;
  }

  std::string closed_because() override {
    wait(kExitCodeMs);
    if (!exit_) return "the program closed its output";
    if (WIFSIGNALED(*exit_)) return fmt::format("the program was ended by signal {}", WTERMSIG(*exit_));
    return fmt::format("the program ended with exit code {}", WEXITSTATUS(*exit_));
  }

  pid_t process_;
  Descriptor handle_;
  std::optional<int> exit_;
};

std::string in_words(const std::vector<std::string>& command) {
  std::string text;
  for (const std::string& word : command) text += (text.empty() ? "" : " ") + word;
  return text;
}

}  // namespace

Result<std::unique_ptr<LinkPort>> spawn_link(const std::vector<std::string>& command) {
  if (command.empty() || command.front().empty()) return fail(Errc::kBadValue, "no program to start was named");
  const std::string text = in_words(command);
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return system_error(Errc::kIo, text, errno);
  Descriptor ours(ends[0]);
  const Descriptor theirs(ends[1]);

  std::vector<std::string> words = command;
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_init(&attributes);
  // dup2 clears close-on-exec, which all other descriptors of this program have.
  posix_spawn_file_actions_adddup2(&actions, theirs.get(), 0);
  posix_spawn_file_actions_adddup2(&actions, theirs.get(), 1);
  // The program must not inherit this thread's blocked signals or this process's ignored signals.
  sigset_t none;
  sigemptyset(&none);
  const sigset_t ignored = ignored_signals(), ending = ending_signals();
  sigset_t defaults;
  sigorset(&defaults, &ignored, &ending);  // a LinkHelper ignores the latter, too
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);

  pid_t process = -1;
  const int error = posix_spawnp(&process, argv[0], &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) {
    return fail(Errc::kNotFound, "there is no program \"" + command.front() + "\"; install it or correct PATH");
  }
  if (error != 0) return system_error(Errc::kIo, "starting \"" + text + "\"", error);
  const int fd = ours.get();
  return std::make_unique<SpawnedLink>(std::move(ours), fd, process, text);
}

}  // namespace nodal::hal
