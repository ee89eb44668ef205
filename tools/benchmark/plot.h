/// @file plot.h
/// Plots by gnuplot.
#pragma once

#include <string>
#include <string_view>

namespace limber::tools {

class Program;

struct PlotSize {
  int width, height;  ///< px
};

/// @param data becomes the file "data.csv" @param commands of gnuplot, without terminal and output
/// @return the SVG; empty where gnuplot is missing or fails
std::string svg_by_gnuplot(PlotSize size, std::string_view data, std::string_view commands);

/// Writes the SVG, or warns that there is none.
void write_plot(Program& program, const std::string& path, const std::string& svg);

}  // namespace limber::tools
