// Text for POV-Ray, as the examples that make pictures write it. World axes are right-handed with z up.
#pragma once

#include <cstdio>
#include <span>
#include <string>

template <class... Values>
void add(std::string& text, const char* format, Values... values) {
  char buffer[256];
  text.append(buffer, static_cast<std::size_t>(std::snprintf(buffer, sizeof buffer, format, values...)));
}

/// A list of a mesh2: 3 numbers per item.
inline void add_vectors(std::string& text, const char* name, std::span<const float> xyz) {
  add(text, "  %s { %zu", name, xyz.size() / 3);
  for (std::size_t i = 0; i < xyz.size(); i += 3)
    add(text, ",\n<%.6g,%.6g,%.6g>", static_cast<double>(xyz[i]), static_cast<double>(xyz[i + 1]),
        static_cast<double>(xyz[i + 2]));
  text += " }\n";
}

/// Sky, two lights and what is in front of everything; `Size` is the size of what is shown, m.
inline std::string povray_stage(double size) {
  std::string text = "#version 3.7;\nglobal_settings { assumed_gamma 1.0 }\nbackground { rgb <0.93, 0.95, 0.97> }\n";
  add(text, "#declare Size = %.6g;\n", size);
  text +=
      R"(light_source { <-6, -9, 12> * Size rgb 0.95 area_light <3, 0, 0> * Size, <0, 3, 0> * Size, 5, 5 adaptive 1 jitter }
light_source { <9, -6, 5> * Size rgb 0.30 shadowless }
fog { fog_type 1 distance 110 * Size rgb <0.93, 0.95, 0.97> }
)";
  return text;
}
