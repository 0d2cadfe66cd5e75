// Program that writes the transition table (daemon/control/control.h) as Promela for the Spin
// models, or as the table of docs/protocol.md.
#include <cstdio>
#include <string>
#include <string_view>

#include "daemon/control/control.h"

namespace v3d {
namespace {

template <class Enum>
void define_all(const char* prefix, int count) {
  for (int i = 0; i < count; ++i) {
    const std::string_view word = name(static_cast<Enum>(i));
    std::printf("#define %s_%s %d\n", prefix, word == "-" ? "none" : std::string(word).c_str(), i);
  }
}

/// Writes transition() of every phase and input. The arrays are hidden: they are constant, so Spin
/// needs no copy of them in a state.
void write_promela() {
  std::puts("/* Generated from daemon/control/control.h by write_transitions. */");
  define_all<control::Phase>("P", control::kPhaseCount);
  define_all<control::Input>("I", control::kInputCount);
  define_all<control::Work>("W", 6);
  define_all<control::Verdict>("V", 4);
  const int size = control::kPhaseCount * control::kInputCount;
  for (const char* column : {"next", "work", "verdict"}) {
    std::printf("hidden byte table_%s[%d];\n", column, size);
  }
  std::puts("inline fill_table() {");
  for (int i = 0; i < size; ++i) {
    const control::Transition t = transition(static_cast<control::Phase>(i / control::kInputCount),
                                             static_cast<control::Input>(i % control::kInputCount));
    std::printf("  table_next[%d] = %d; table_work[%d] = %d; table_verdict[%d] = %d;\n", i,
                static_cast<int>(t.next), i, static_cast<int>(t.work), i,
                static_cast<int>(t.verdict));
  }
  std::printf(
      "}\n#define row(phase, input) ((phase) * %d + (input))\n"
      "inline lookup(phase, input) {\n"
      "  next_phase = table_next[row(phase, input)];\n"
      "  work = table_work[row(phase, input)];\n"
      "  verdict = table_verdict[row(phase, input)]\n}\n",
      control::kInputCount);
}

void write_markdown() {
  std::puts("| phase | input | next phase | work | answer |\n| --- | --- | --- | --- | --- |");
  for (const control::TransitionRow& row : control::kTransitionTable) {
    const auto cell = [](std::string_view word) { return std::string(word); };
    std::printf("| %s | %s | %s | %s | %s |\n", cell(name(row.phase)).c_str(),
                cell(name(row.input)).c_str(), cell(name(row.transition.next)).c_str(),
                cell(name(row.transition.work)).c_str(),
                cell(name(row.transition.verdict)).c_str());
  }
}

}  // namespace
}  // namespace v3d

int main(int argc, char** argv) {
  const std::string_view format = argc == 2 ? argv[1] : "";
  if (format == "promela") {
    v3d::write_promela();
  } else if (format == "markdown") {
    v3d::write_markdown();
  } else {
    std::fputs("usage: write_transitions promela|markdown\n", stderr);
    return 2;
  }
  return 0;
}
