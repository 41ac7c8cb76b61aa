"""Result rows, their schema, the result folder, and statistics over them."""
