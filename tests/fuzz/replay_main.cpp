// A plain main for a fuzz target: runs the corpus, then seeded mutations of it. The same seed and count give the same
// inputs on every machine. An input that crashes or hangs is saved to a file, which standard error names; pass that
// file to the program to repeat the crash.
//
//   fuzz_NAME CORPUS_FOLDER|FILE ... [--mutations N] [--seed N]
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kLongestInput = 1U << 16;
constexpr unsigned kLongestSeconds = 20;
constexpr char kLeftBehind[] = "fuzz-input-that-failed";

const Bytes* running = nullptr;
std::uint64_t executions = 0;

// Only async-signal-safe calls.
extern "C" void leave_input(int number) {
  const int fd = ::open(kLeftBehind, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (fd >= 0 && running != nullptr) {
    static_cast<void>(!::write(fd, running->data(), running->size()));
    ::close(fd);
  }
  char digits[24];
  std::size_t first = sizeof(digits);
  for (std::uint64_t rest = executions; first == sizeof(digits) || rest > 0; rest /= 10) {
    digits[--first] = static_cast<char>('0' + rest % 10);
  }
  constexpr char kSaid[] = "\nthe input that failed is in ./fuzz-input-that-failed; executions: ";
  static_cast<void>(!::write(2, kSaid, sizeof(kSaid) - 1));
  static_cast<void>(!::write(2, digits + first, sizeof(digits) - first));
  static_cast<void>(!::write(2, "\n", 1));
  ::signal(number, SIG_DFL);
  ::raise(number == SIGALRM ? SIGABRT : number);
}

void run(const Bytes& input) {
  running = &input;
  ++executions;
  ::alarm(kLongestSeconds);
  // A block of exactly this size, so that a sanitizer detects a read past its end.
  const Bytes exact(input);
  LLVMFuzzerTestOneInput(exact.data(), exact.size());
  ::alarm(0);
  running = nullptr;
}

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  Bytes mutate(const std::vector<Bytes>& corpus) {
    Bytes bytes = corpus[below(corpus.size())];
    for (std::size_t times = 1 + below(4); times > 0; --times) once(bytes, corpus);
    if (bytes.size() > kLongestInput) bytes.resize(kLongestInput);
    return bytes;
  }

 private:
  std::size_t below(std::size_t n) { return n == 0 ? 0 : static_cast<std::size_t>(random_() % n); }
  auto place(Bytes& bytes, std::size_t at) { return bytes.begin() + static_cast<std::ptrdiff_t>(at); }

  void once(Bytes& bytes, const std::vector<Bytes>& corpus) {
    static constexpr std::uint8_t kTelling[] = {0, 1, 0x7F, 0x80, 0xFF, '"', '{', '[', '-', '\n', '#', 0xC3};
    const std::size_t at = below(bytes.size());
    switch (below(8)) {
      case 0:
        if (!bytes.empty()) bytes[at] ^= static_cast<std::uint8_t>(1U << below(8));
        break;
      case 1:
        if (!bytes.empty()) bytes[at] = static_cast<std::uint8_t>(random_());
        break;
      case 2:
        if (!bytes.empty()) bytes[at] = kTelling[below(std::size(kTelling))];
        break;
      case 3: bytes.resize(at); break;
      case 4: bytes.insert(place(bytes, at), 1 + below(8), kTelling[below(std::size(kTelling))]); break;
      case 5: {
        const std::size_t n = std::min(1 + below(16), bytes.size() - at);
        bytes.erase(place(bytes, at), place(bytes, at + n));
        break;
      }
      case 6: {  // a copy of a piece of the same input
        const Bytes piece(place(bytes, at), place(bytes, at + below(bytes.size() - at)));
        bytes.insert(place(bytes, below(bytes.size())), piece.begin(), piece.end());
        break;
      }
      default: {  // a piece of another input
        const Bytes& other = corpus[below(corpus.size())];
        const std::size_t from = below(other.size());
        const auto begin = other.begin() + static_cast<std::ptrdiff_t>(from);
        const auto end = begin + static_cast<std::ptrdiff_t>(below(other.size() - from));
        bytes.insert(place(bytes, at), begin, end);
      }
    }
  }

  std::mt19937_64 random_;
};

std::vector<Bytes> read_corpus(const std::vector<std::filesystem::path>& places) {
  std::vector<std::filesystem::path> files;
  for (const auto& place : places) {
    if (!std::filesystem::is_directory(place)) {
      files.push_back(place);
      continue;
    }
    for (const auto& entry : std::filesystem::directory_iterator(place)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());  // the directory order is arbitrary
  std::vector<Bytes> corpus;
  for (const auto& file : files) {
    std::ifstream in(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    if (!in.good() && !in.eof()) {
      std::fprintf(stderr, "%s: cannot be read\n", file.c_str());
      std::exit(2);
    }
  }
  return corpus;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::filesystem::path> places;
  std::uint64_t mutations = 4000;
  std::uint64_t seed = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if ((word == "--mutations" || word == "--seed") && i + 1 < argc) {
      (word == "--seed" ? seed : mutations) = std::strtoull(argv[++i], nullptr, 10);
    } else {
      places.emplace_back(word);
    }
  }
  for (const int number : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGALRM}) ::signal(number, leave_input);

  const std::vector<Bytes> corpus = read_corpus(places);
  if (corpus.empty()) {
    std::fprintf(stderr, "no corpus: name a folder with at least one file in it\n");
    return 2;
  }
  for (const Bytes& input : corpus) run(input);
  Mutator mutator(seed);
  for (std::uint64_t i = 0; i < mutations; ++i) run(mutator.mutate(corpus));
  std::printf("%zu files of corpus and %llu mutations of seed %llu: no failure\n", corpus.size(),
              static_cast<unsigned long long>(mutations), static_cast<unsigned long long>(seed));
  return 0;
}
