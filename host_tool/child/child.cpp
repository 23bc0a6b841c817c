#include "host_tool/child/child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "protocol/base/text.h"

namespace nodal {
namespace {

constexpr int kPipeBytes = 1 << 20;  // the default limit of /proc/sys/fs/pipe-max-size

/// Descriptors are closed in every other child, or a decoder's pipe would stay open in the encoder.
struct Pipe {
  int read_end = -1;
  int write_end = -1;

  Pipe() = default;
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  ~Pipe() {
    if (read_end >= 0) ::close(read_end);
    if (write_end >= 0) ::close(write_end);
  }
  bool open() {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) return false;
    read_end = ends[0];
    write_end = ends[1];
    (void)::fcntl(write_end, F_SETPIPE_SZ, kPipeBytes);  // a smaller pipe works, too
    return true;
  }
};

void limit(__rlimit_resource resource, rlim_t value) {
  const rlimit both{value, value};
  ::setrlimit(resource, &both);
}

/// This process's, and words for malloc(): by default it gives the memory of each picture back to the kernel, which
/// clears it again for the next one: 2 % of the processor time of an H.264 encoder.
std::vector<char*> environment_of_children() {
  static char keeps[] = "MALLOC_TRIM_THRESHOLD_=268435456", takes[] = "MALLOC_MMAP_THRESHOLD_=33554432";
  std::vector<char*> all{keeps, takes};
  for (char** word = environ; *word != nullptr; ++word) all.push_back(*word);
  all.push_back(nullptr);
  return all;
}

/// Between fork() and execve(): only calls that are safe there (signal-safety(7)).
[[noreturn]] void become(const ChildSpec& spec, char* const* words, char* const* environment, int in, int out,
                         int errors, pid_t parent) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(127);
  for (int number = 1; number < NSIG; ++number) ::signal(number, SIG_DFL);
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  limit(RLIMIT_CORE, 0);
  if (!spec.writes_files) limit(RLIMIT_FSIZE, 0);
  if (spec.memory > 0) limit(RLIMIT_AS, spec.memory);
  if (!spec.folder.empty() && ::chdir(spec.folder.c_str()) != 0) ::_exit(127);
  ::dup2(in, STDIN_FILENO);
  ::dup2(out, STDOUT_FILENO);
  ::dup2(errors, STDERR_FILENO);
  ::execve(spec.program.c_str(), words, environment);
  ::_exit(127);
}

}  // namespace

Result<std::unique_ptr<Child>> Child::start(const ChildSpec& spec) {
  Pipe in, out, errors;
  const int null = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  const auto failed = [&](const char* what) {
    const int error = errno;
    if (null >= 0) ::close(null);
    return fail(Errc::kIo, fmt::format("{} cannot be started: {}: {}", spec.program, what, std::strerror(error)));
  };
  if (null < 0) return failed("/dev/null");
  if ((spec.input && !in.open()) || (spec.output && !out.open()) || !errors.open()) return failed("pipe");
  std::vector<char*> words{const_cast<char*>(spec.program.c_str())};
  for (const std::string& word : spec.arguments) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  const std::vector<char*> environment = environment_of_children();
  const pid_t parent = ::getpid();
  const pid_t pid = ::fork();
  if (pid < 0) return failed("fork");
  if (pid == 0) {
    become(spec, words.data(), environment.data(), spec.input ? in.read_end : null, spec.output ? out.write_end : null,
           errors.write_end, parent);
  }
  ::close(null);
  auto child = std::unique_ptr<Child>(new Child);
  child->pid_ = pid;
  child->input_ = std::exchange(in.write_end, -1);
  child->output_ = std::exchange(out.read_end, -1);
  child->errors_ = std::exchange(errors.read_end, -1);
  child->collector_ = std::thread([raw = child.get()] { raw->collect(); });
  return child;
}

Child::~Child() {
  kill();
  wait();
  if (output_ >= 0) ::close(output_);
}

void Child::kill() {
  if (!ended_) ::kill(pid_, SIGKILL);
}

void Child::collect() {
  std::array<char, 4096> piece;
  for (;;) {
    const ssize_t count = ::read(errors_, piece.data(), piece.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return;
    const std::size_t room = kMaxComplaint - complaint_.size();
    complaint_.append(piece.data(), std::min(room, static_cast<std::size_t>(count)));
  }
}

Result<std::size_t> Child::read(std::span<std::uint8_t> into) {
  for (;;) {
    const ssize_t count = ::read(output_, into.data(), into.size());
    if (count >= 0) return static_cast<std::size_t>(count);
    if (errno != EINTR) return fail(Errc::kIo, fmt::format("its output cannot be read: {}", std::strerror(errno)));
  }
}

Result<std::string> Child::read_all(std::size_t limit) {
  std::string text;
  std::array<std::uint8_t, 65536> piece;
  for (;;) {
    const auto count = read(piece);
    if (!count) return fail(count.error());
    if (*count == 0) return text;
    if (text.size() + *count > limit) return fail(Errc::kTooLarge, fmt::format("its answer is over {} bytes", limit));
    text.append(reinterpret_cast<const char*>(piece.data()), *count);
  }
}

Status Child::write(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(input_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return fail(Errc::kLinkClosed, fmt::format("it takes no more frames: {}", std::strerror(errno)));
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return {};
}

void Child::close_input() {
  if (input_ >= 0) ::close(std::exchange(input_, -1));
}

Child::End Child::wait() {
  if (ended_) return end_;
  close_input();
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {}
  ended_ = true;
  if (collector_.joinable()) collector_.join();
  if (errors_ >= 0) ::close(std::exchange(errors_, -1));
  if (WIFSIGNALED(status)) end_.signal = WTERMSIG(status);
  else end_.code = WEXITSTATUS(status);
  return end_;
}

std::string Child::complaint() const {
  // ffmpeg repeats itself; its first two lines say where and what.
  std::string text = complaint_;
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  const std::size_t first = text.find('\n');
  const std::size_t second = first == std::string::npos ? first : text.find('\n', first + 1);
  if (second != std::string::npos) text.erase(second);
  std::string line;
  for (const char c : text) line += c == '\n' ? std::string("; ") : std::string(1, c);
  return printable(line, 300);
}

std::string end_of(const Child::End& end, const std::string& complaint) {
  if (end.signal != 0) {
    return fmt::format("was killed by signal {} ({})", end.signal, ::strsignal(end.signal));
  }
  if (end.code == 127 && complaint.empty()) return "could not be started";
  return complaint.empty() ? fmt::format("failed with exit code {}", end.code) : "failed: " + complaint;
}

}  // namespace nodal
