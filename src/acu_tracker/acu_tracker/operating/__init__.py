"""Operation of the antenna outside the law: commands and control of clients, texts and diagnosis for the operator."""
